// The fit of meshes that follow each other within a frame.
#include "tracking/fitted.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"
#include "support/carved.h"

namespace isotrack {
namespace {

using support::Carved;
using support::kEdge;
using support::kResolution;

double sharpest_cotangent(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
    double result = 0.0;
    for (const Triangle& t : triangles)
        for (int k = 0; k < 3; ++k) {
            const Vec3 u = points[t[(k + 1) % 3]] - points[t[k]], w = points[t[(k + 2) % 3]] - points[t[k]];
            result = std::max(result, u.dot(w) / u.cross(w).norm());
        }
    return result;
}

/// The integral of the squared distance.
double squared_error(const FrameMesh& mesh, const Surface& surface) {
    const auto errors = triangle_errors(mesh.vertices, mesh.carved.triangles, surface, 6);
    double sum = 0.0;
    for (std::size_t t = 0; t < errors.size(); ++t) {
        const auto& [i, j, k] = mesh.carved.triangles[t];
        const auto& p = mesh.vertices;
        sum += errors[t].mean_square * (p[j] - p[i]).cross(p[k] - p[i]).norm();
    }
    return sum;
}

std::size_t count_flipped(const FrameMesh& mesh, const FrameMesh& carved) {
    std::size_t count = 0;
    for (std::size_t t = 0; t < mesh.carved.triangles.size(); ++t)
        count += mesh.carved.triangles[t] != carved.carved.triangles[t];
    return count;
}

void expect_sound(const FrameMesh& mesh) {
    const TriangleMesh as_mesh{mesh.vertices, mesh.carved.triangles, {}, {}};
    const MeshTopology topology = mesh_topology(as_mesh);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_EQ(topology.euler, 2);
    EXPECT_TRUE(self_intersections(as_mesh).empty());
}

/// A box, whose edges no seed is on: flips and moves do much there.
struct FitOfABox : ::testing::TestWithParam<double> {
    const double tolerance = GetParam();
    const shapes::SurfacePtr box = shapes::box({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution);
    Carved carved{*box, tolerance};
    const FrameMesh unfitted = carved.mesh();
    const std::size_t particles = carved.particles.size();
    Fitted fitted;
    FrameMesh first = unfitted;

    FitOfABox() {
        fitted.fit_vertices(first, particles, *box, tolerance);
        fitted.undo_crossing(first, carved.particles.position);
    }
};

TEST_P(FitOfABox, MovesVerticesAndFlipsEdges) {
    expect_sound(first);
    EXPECT_LT(squared_error(first, *box), 0.6 * squared_error(unfitted, *box));
    const std::size_t flips_wanted = tolerance < kResolution ? 0 : 2;
    EXPECT_GE(count_flipped(first, unfitted), flips_wanted);
    EXPECT_LE(
        sharpest_cotangent(first.vertices, first.carved.triangles),
        std::max(std::sqrt(3.0), sharpest_cotangent(unfitted.vertices, unfitted.carved.triangles)) + 1e-5);
    EXPECT_EQ(first.carved.particle, unfitted.carved.particle);
    EXPECT_EQ(first.carved.facet, unfitted.carved.facet);
}

TEST_P(FitOfABox, FlipsNothingWithoutATolerance) {
    FrameMesh mesh = unfitted;
    Fitted other;
    other.fit_vertices(mesh, particles, *box, std::nullopt);
    EXPECT_EQ(mesh.carved.triangles, unfitted.carved.triangles);
    EXPECT_LT(squared_error(mesh, *box), squared_error(unfitted, *box));
}

TEST_P(FitOfABox, TellsFlippedTriangles) {
    for (std::size_t t = 0; t < first.carved.triangles.size(); ++t) {
        EXPECT_EQ(is_flipped(first.carved, t, carved.cells),
                  first.carved.triangles[t] != unfitted.carved.triangles[t]);
        EXPECT_FALSE(is_flipped(unfitted.carved, t, carved.cells));
    }
}

TEST_P(FitOfABox, IsTheSameWhereTheMeshIs) {
    FrameMesh again = unfitted;
    fitted.fit_vertices(again, particles, *box, tolerance);
    EXPECT_EQ(again.carved.triangles, first.carved.triangles);
    // Around a particle with two vertices it is made anew: which was where is not known.
    std::vector<Vec3> shared;
    std::set<int> seen;
    for (std::size_t v = 0; v < unfitted.vertices.size(); ++v)
        if (!seen.insert(unfitted.carved.particle[v]).second) shared.push_back(unfitted.vertices[v]);
    std::size_t same = 0;
    for (std::size_t v = 0; v < unfitted.vertices.size(); ++v) {
        if (std::any_of(shared.begin(), shared.end(),
                        [&](const Vec3& p) { return (p - unfitted.vertices[v]).norm() < 4.0 * kEdge; }))
            continue;
        EXPECT_EQ(again.vertices[v], first.vertices[v]);
        ++same;
    }
    EXPECT_GT(same, unfitted.vertices.size() / 2);
}

TEST_P(FitOfABox, ChangesWithTheMeshAlone) {
    // A cell more inside, where that leaves a sphere.
    FrameMesh other;
    std::vector<char> differs;
    for (std::size_t c = 0; c < carved.cells.size(); ++c) {
        if (carved.labels[c] || carved.cells.is_infinite(static_cast<int>(c))) continue;
        carved.labels[c] = 1;
        other = carved.mesh();
        carved.labels[c] = 0;
        if (other.vertices.size() != unfitted.vertices.size() ||
            mesh_topology({other.vertices, other.carved.triangles, {}, {}}).euler != 2)
            continue;
        std::set<Triangle> before(unfitted.carved.triangles.begin(), unfitted.carved.triangles.end());
        differs.clear();
        for (const Triangle& t : other.carved.triangles) differs.push_back(before.count(t) == 0);
        break;
    }
    ASSERT_TRUE(std::find(differs.begin(), differs.end(), 1) != differs.end());
    const std::vector<Triangle> carved_triangles = other.carved.triangles;
    const std::vector<Vec3> unfitted_other = other.vertices;
    fitted.fit_vertices(other, particles, *box, tolerance);

    // Only corners of triangles that the last mesh did not have move, and where two vertices are on a
    // particle.
    const std::set<Triangle> triangles(first.carved.triangles.begin(), first.carved.triangles.end());
    std::vector<char> may_move;
    for (const char is_lone : lone_flags(other, lone_vertices(other, particles)))
        may_move.push_back(!is_lone);
    for (std::size_t t = 0; t < differs.size(); ++t)
        for (const Triangle& now : {carved_triangles[t], other.carved.triangles[t]})
            if (differs[t] || triangles.count(now) == 0)
                for (const int v : now) may_move[v] = 1;
    for (std::size_t v = 0; v < may_move.size(); ++v) {
        if (may_move[v]) continue;
        EXPECT_EQ(other.vertices[v], first.vertices[v]);
    }
    EXPECT_LT(std::count(may_move.begin(), may_move.end(), 1),
              static_cast<std::ptrdiff_t>(may_move.size()) / 2);

    fitted.undo_crossing(other, carved.particles.position);
    expect_sound(other);

    std::vector<Vec3> changes;
    for (std::size_t t = 0; t < differs.size(); ++t)
        if (differs[t])
            for (const int v : carved_triangles[t]) changes.push_back(unfitted_other[v]);
    const auto is_far = [&](int v) {
        return std::all_of(changes.begin(), changes.end(),
                           [&](const Vec3& p) { return (p - unfitted_other[v]).norm() > 8.0 * kEdge; });
    };
    std::size_t far = 0;
    for (const Triangle& t : other.carved.triangles) {
        if (!is_far(t[0]) || !is_far(t[1]) || !is_far(t[2])) continue;
        ++far;
        EXPECT_EQ(triangles.count(t), 1u);
        for (const int v : t) EXPECT_EQ(other.vertices[v], first.vertices[v]);
    }
    EXPECT_GT(far, 20u);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, FitOfABox, ::testing::Values(0.02, 0.05, 0.2));

TEST(Fitted, TakesBackWhatCrosses) {
    // The fit is told that both sheets of a plate are outside, and draws them through each other.
    const auto plate = shapes::box({0, 0, 0}, {1.0, 1.0, 0.1}, kResolution);
    const auto lower = shapes::from_function([](const Vec3& p) { return p.z() + 0.5; },
                                             Box(Vec3(-2, -2, -2), Vec3(2, 2, 2)), kResolution);
    Carved carved(*plate, 0.05);
    const FrameMesh unfitted = carved.mesh();
    FrameMesh mesh = unfitted;
    Fitted fitted;
    fitted.fit_vertices(mesh, carved.particles.size(), *lower, 10.0);
    ASSERT_FALSE(self_intersections(mesh.vertices, mesh.carved.triangles).empty());
    const std::vector<Vec3> before = mesh.vertices;
    EXPECT_TRUE(fitted.undo_crossing(mesh, carved.particles.position));
    EXPECT_TRUE(self_intersections(mesh.vertices, mesh.carved.triangles).empty());
    std::size_t back = 0;
    for (std::size_t v = 0; v < before.size(); ++v) {
        if (mesh.vertices[v] == before[v]) continue;
        EXPECT_EQ(mesh.vertices[v], unfitted.vertices[v]);
        ++back;
    }
    EXPECT_GT(back, 10u);
    EXPECT_FALSE(fitted.undo_crossing(mesh, carved.particles.position));
}

}  // namespace
}  // namespace isotrack
