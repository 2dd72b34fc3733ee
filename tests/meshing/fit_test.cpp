// Fitting vertices off the surface.
#include "isotrack/meshing/fit.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Mean of the signed distance to the unit sphere over the area of a mesh.
double mean_signed_error(const TriangleMesh& mesh) {
    double sum = 0.0, area = 0.0;
    constexpr int kSteps = 8;
    for (const auto& [a, b, c] : mesh.triangles) {
        const double weight = (mesh.points[b] - mesh.points[a]).cross(mesh.points[c] - mesh.points[a]).norm();
        double mean = 0.0;
        int count = 0;
        for (int i = 0; i < kSteps; ++i)
            for (int j = 0; i + j < kSteps; ++j, ++count) {
                const double u = (i + 1.0 / 3.0) / kSteps, v = (j + 1.0 / 3.0) / kSteps;
                mean += ((1 - u - v) * mesh.points[a] + u * mesh.points[b] + v * mesh.points[c]).norm() - 1.0;
            }
        sum += weight * mean / count;
        area += weight;
    }
    return sum / area;
}

TEST(Fit, AveragesTheSignedErrorOfASphereOut) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    TriangleMesh mesh = support::icosphere(2);
    const double before = mean_signed_error(mesh);
    const auto errors_before = triangle_errors(mesh.points, mesh.triangles, *sphere, 6);
    ASSERT_LT(before, 0.0);
    fit(mesh.points, mesh.triangles, *sphere, 6);
    EXPECT_LT(std::abs(mean_signed_error(mesh)), 0.1 * std::abs(before));
    // The root mean square falls too.
    const auto errors = triangle_errors(mesh.points, mesh.triangles, *sphere, 6);
    const auto sum = [](const std::vector<TriangleError>& all) {
        return std::accumulate(all.begin(), all.end(), 0.0,
                               [](double s, const TriangleError& e) { return s + e.mean_square; });
    };
    EXPECT_LT(sum(errors), 0.5 * sum(errors_before));
    EXPECT_NEAR(enclosed_volume(mesh), 4.0 / 3.0 * kPi, 0.02);
}

TEST(Fit, NeverStepsFurtherThanATenthOfTheShortestEdge) {
    TriangleMesh mesh = support::icosphere(2);
    const auto far = shapes::sphere({0, 0, 0}, 3.0, 0.1);
    std::vector<double> shortest(mesh.points.size(), 1e300);
    for (const auto& t : mesh.triangles)
        for (int k = 0; k < 3; ++k)
            for (const int end : {1, 2})
                shortest[t[k]] =
                    std::min(shortest[t[k]], (mesh.points[t[(k + end) % 3]] - mesh.points[t[k]]).norm());
    TriangleMesh moved = mesh;
    fit(moved.points, moved.triangles, *far, 1);
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
        EXPECT_NEAR((moved.points[v] - mesh.points[v]).norm(), 0.1 * shortest[v], 1e-12);
}

TEST(Fit, PullsVerticesIntoTheEdgesOfABox) {
    // A box wrapped by a sphere's mesh with its vertices on the surface: edges and corners are cut off.
    const auto box = shapes::box({0, 0, 0}, {0.6, 0.5, 0.4}, 0.02);
    TriangleMesh mesh = support::icosphere(4);
    for (Vec3& p : mesh.points) {
        const double reach = std::max({std::abs(p.x()) / 0.6, std::abs(p.y()) / 0.5, std::abs(p.z()) / 0.4});
        p /= reach;
    }
    const auto rms = [&] {
        double sum = 0.0;
        for (const TriangleError& e : triangle_errors(mesh.points, mesh.triangles, *box, 6))
            sum += e.mean_square;
        return std::sqrt(sum / static_cast<double>(mesh.triangles.size()));
    };
    const double before = rms();
    fit(mesh.points, mesh.triangles, *box, 20);
    EXPECT_LT(rms(), 0.4 * before);
    EXPECT_TRUE(self_intersections(mesh).empty());
}

TEST(Fit, LeavesNoTriangleSharperThanItMay) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    TriangleMesh mesh = support::icosphere(2);
    // Vertices thrown about on the sphere: some triangles start below 30 degrees, most above.
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        const double a = 1.7 * static_cast<double>(v);
        mesh.points[v] =
            (mesh.points[v] + 0.06 * Vec3(std::cos(a), std::sin(2 * a), std::sin(a))).normalized();
    }
    const auto smallest = [&](const TriangleMesh& m, const Triangle& t) {
        double least = 180.0;
        for (int k = 0; k < 3; ++k) {
            const Vec3 u = (m.points[t[(k + 1) % 3]] - m.points[t[k]]).normalized(),
                       w = (m.points[t[(k + 2) % 3]] - m.points[t[k]]).normalized();
            least = std::min(least, std::acos(std::clamp(u.dot(w), -1.0, 1.0)) * 180.0 / kPi);
        }
        return least;
    };
    TriangleMesh fitted = mesh;
    fit(fitted.points, fitted.triangles, *sphere, 30);
    int sharp = 0, moved = 0;
    for (const Triangle& t : mesh.triangles) {
        const double before = smallest(mesh, t), after = smallest(fitted, t);
        EXPECT_GT(after, std::min(before, 30.0) - 1e-6);
        sharp += before < 30.0;
        moved += std::abs(after - before) > 1.0;
    }
    EXPECT_GT(sharp, 5);
    EXPECT_GT(moved, 50);
}

/// A bump in a hexagonal grid over a flat surface. The vertices on the border are to stay.
struct Bump {
    static constexpr int kSize = 9;
    TriangleMesh mesh;
    std::vector<char> movable;
    shapes::SurfacePtr ground = shapes::from_function([](const Vec3& p) { return p.z(); },
                                                      Box(Vec3(-1, -1, -1), Vec3(10, 10, 1)), 0.1);
    explicit Bump(double height) {
        for (int i = 0; i < kSize; ++i)
            for (int j = 0; j < kSize; ++j) {
                const bool inner = i > 0 && j > 0 && i + 1 < kSize && j + 1 < kSize;
                movable.push_back(inner);
                mesh.points.emplace_back(i + 0.5 * j, std::sqrt(0.75) * j, inner ? height : 0.0);
            }
        const auto at = [](int i, int j) { return i * kSize + j; };
        for (int i = 0; i + 1 < kSize; ++i)
            for (int j = 0; j + 1 < kSize; ++j)
                mesh.triangles.insert(mesh.triangles.end(), {{at(i, j), at(i + 1, j), at(i, j + 1)},
                                                             {at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)}});
    }
};

TEST(Fit, LeavesASixthInTwoSteps) {
    // A third of the vertices, none next to another: what is alike at neighbours is fitted fastest, what
    // differs most slowest. So low that facets do not turn.
    Bump bump(1e-4);
    for (int v = 0; v < Bump::kSize * Bump::kSize; ++v)
        if ((v / Bump::kSize + 2 * (v % Bump::kSize)) % 3 != 0) bump.mesh.points[v].z() = 0.0;
    const auto off = [](const Bump& b) {
        double sum = 0.0;
        for (const Vec3& p : b.mesh.points) sum += p.z() * p.z();
        return std::sqrt(sum);
    };
    for (int readings = 1; readings <= 2; ++readings) {
        Bump fitted = bump;
        fit(fitted.mesh.points, fitted.mesh.triangles, *bump.ground, 2 * readings, fitted.movable);
        EXPECT_LT(off(fitted), std::pow(0.18, readings) * off(bump));
        EXPECT_GT(off(fitted), 0.0);
    }
}

TEST(Fit, GivesTheSameBitsAtAnyThreadCount) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const TriangleMesh mesh = support::icosphere(3);
    auto many = mesh.points, one = mesh.points;
    fit(many, mesh.triangles, *sphere, 3);
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, 1);
    fit(one, mesh.triangles, *sphere, 3);
    EXPECT_EQ(many, one);
}

}  // namespace
}  // namespace isotrack
