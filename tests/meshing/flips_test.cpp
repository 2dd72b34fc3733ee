// Flips on meshes whose sharp triangles are known.
#include "isotrack/meshing/flips.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

double smallest_angle(const std::vector<Vec3>& points, const Triangle& t) {
    double least = 180.0;
    for (int k = 0; k < 3; ++k) {
        const Vec3 u = (points[t[(k + 1) % 3]] - points[t[k]]).normalized(),
                   w = (points[t[(k + 2) % 3]] - points[t[k]]).normalized();
        least = std::min(least, std::acos(std::clamp(u.dot(w), -1.0, 1.0)) * 180.0 / std::acos(-1.0));
    }
    return least;
}

/// A unit sphere with vertices thrown about on it.
TriangleMesh rough_sphere() {
    TriangleMesh mesh = support::icosphere(3);
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        const double a = 1.7 * static_cast<double>(v);
        mesh.points[v] =
            (mesh.points[v] + 0.05 * Vec3(std::cos(a), std::sin(2 * a), std::sin(a))).normalized();
    }
    return mesh;
}

TEST(FlipSharp, MakesSharpTrianglesBlunterAndKeepsTheMeshSound) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const TriangleMesh before = rough_sphere();
    TriangleMesh after = before;
    constexpr double kTolerance = 0.05;
    const std::vector<Flip> flips = flip_sharp(after.points, after.triangles, *sphere, kTolerance);
    ASSERT_GT(flips.size(), 5u);
    std::set<int> vertices;
    for (const Flip& flip : flips) {
        double old_angle = 180.0, new_angle = 180.0;
        for (int i = 0; i < 2; ++i) {
            EXPECT_EQ(flip.before[i], before.triangles[flip.triangle[i]]);
            old_angle = std::min(old_angle, smallest_angle(before.points, flip.before[i]));
            new_angle = std::min(new_angle, smallest_angle(after.points, after.triangles[flip.triangle[i]]));
        }
        EXPECT_LT(old_angle, 30.0);
        EXPECT_GT(new_angle, 1.05 * old_angle);
        std::set<int> own;
        for (const Triangle& t : flip.before) own.insert(t.begin(), t.end());
        EXPECT_EQ(own.size(), 4u);
        for (const int v : own) EXPECT_TRUE(vertices.insert(v).second) << "two flips at vertex " << v;
    }
    const MeshTopology topology = mesh_topology(after);
    EXPECT_TRUE(topology.closed() && topology.manifold() && topology.oriented());
    EXPECT_EQ(topology.euler, 2);
    EXPECT_TRUE(self_intersections(after).empty());
    for (const TriangleError& e : triangle_errors(after.points, after.triangles, *sphere, 6))
        EXPECT_LE(e.largest, kTolerance);
    for (const Flip& flip : flips) undo(flip, after.triangles);
    EXPECT_EQ(after.triangles, before.triangles);
}

TEST(FlipSharp, LeavesAMeshWithoutSharpTrianglesAlone) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    TriangleMesh mesh = support::icosphere(2);
    const auto before = mesh.triangles;
    EXPECT_TRUE(flip_sharp(mesh.points, mesh.triangles, *sphere, 0.1).empty());
    EXPECT_EQ(mesh.triangles, before);
}

TEST(FlipSharp, KeepsTheTolerance) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    TriangleMesh all = rough_sphere(), few = rough_sphere();
    const std::vector<Flip> most = flip_sharp(all.points, all.triangles, *sphere, 0.05);
    const auto error_of = [&](const Flip& flip) {
        double largest = 0.0;
        for (const TriangleError& e : triangle_errors(
                 all.points, {all.triangles[flip.triangle[0]], all.triangles[flip.triangle[1]]}, *sphere, 6))
            largest = std::max(largest, e.largest);
        return largest;
    };
    double tolerance = 0.0;
    for (const Flip& flip : most) tolerance = std::max(tolerance, 0.99 * error_of(flip));
    const std::vector<Flip> fewer = flip_sharp(few.points, few.triangles, *sphere, tolerance);
    EXPECT_FALSE(fewer.empty());
    EXPECT_LT(fewer.size(), most.size());
}

TEST(FlipSharp, CrossesNoOtherPartOfTheMesh) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    TriangleMesh free = rough_sphere();
    const std::vector<Flip> flips = flip_sharp(free.points, free.triangles, *sphere, 0.05);
    ASSERT_FALSE(flips.empty());
    // A crumb on the new diagonal of the first flip.
    const auto& [t, u] = flips[0].before;
    const auto has = [](const Triangle& triangle, int v) {
        return std::find(triangle.begin(), triangle.end(), v) != triangle.end();
    };
    Vec3 middle = Vec3::Zero();  // of the new diagonal
    for (const int v : t)
        if (!has(u, v)) middle += 0.5 * free.points[v];
    for (const int v : u)
        if (!has(t, v)) middle += 0.5 * free.points[v];
    double apart = 1.0;  // from the planes of the triangles as they were
    for (const Triangle& old : {t, u}) {
        const Vec3& p = free.points[old[0]];
        const Vec3 normal = (free.points[old[1]] - p).cross(free.points[old[2]] - p).normalized();
        apart = std::min(apart, std::abs(normal.dot(middle - p)));
    }
    ASSERT_GT(apart, 1e-6);
    const double size = 0.2 * apart;
    TriangleMesh mesh =
        support::join(rough_sphere(), support::tetrahedron(middle - Vec3::Constant(0.25 * size), size));
    ASSERT_TRUE(self_intersections(mesh).empty());
    const std::vector<Flip> others = flip_sharp(mesh.points, mesh.triangles, *sphere, 0.05);
    EXPECT_TRUE(self_intersections(mesh).empty());
    for (const Flip& flip : others) EXPECT_NE(flip.triangle, flips[0].triangle);
}

}  // namespace
}  // namespace isotrack
