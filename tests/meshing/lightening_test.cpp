// Lightening of meshes whose surface is known.
#include "meshing/lightening.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/distance.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Cosine of the smallest angle of a triangle.
double sharpest(const TriangleMesh& mesh, const Triangle& t) {
    double most = -1.0;
    for (int k = 0; k < 3; ++k) {
        const Vec3& p = mesh.points[t[k]];
        most = std::max(most, (mesh.points[t[(k + 1) % 3]] - p)
                                  .normalized()
                                  .dot((mesh.points[t[(k + 2) % 3]] - p).normalized()));
    }
    return most;
}

void expect_sound(const TriangleMesh& mesh) {
    const MeshTopology topology = mesh_topology(mesh);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_TRUE(self_intersections(mesh).empty());
}

/// What is left of a mesh, with all its points.
TriangleMesh lightened(const TriangleMesh& mesh, const std::vector<char>& may_go, const Surface& surface,
                       const CrossingGrid& reached, double tolerance) {
    TriangleMesh result = mesh;
    const Lightened done =
        lighten(mesh.points, result.triangles, may_go, surface, {&reached}, tolerance, surface.resolution());
    std::vector<Triangle> left;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        if (done.gone[t]) continue;
        EXPECT_EQ(done.changed[t] != 0, result.triangles[t] != mesh.triangles[t]);
        left.push_back(result.triangles[t]);
    }
    result.triangles = left;
    return result;
}

std::set<int> used(const TriangleMesh& mesh) {
    std::set<int> result;
    for (const Triangle& t : mesh.triangles) result.insert(t.begin(), t.end());
    return result;
}

TEST(Lightening, LeavesOfASphereWhatItsToleranceNeeds) {
    constexpr double kTolerance = 0.02;
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const TriangleMesh mesh = support::icosphere(4);
    std::vector<Surface::Crossing> crossings;
    for (const Vec3& p : mesh.points) crossings.push_back({p, p.cast<float>()});
    const CrossingGrid reached(crossings, 0.05);
    const TriangleMesh light =
        lightened(mesh, std::vector<char>(mesh.points.size(), 1), *sphere, reached, kTolerance);
    expect_sound(light);
    EXPECT_EQ(mesh_topology(light).euler, 2);
    EXPECT_LT(light.triangles.size(), mesh.triangles.size() / 8);
    for (const Triangle& t : light.triangles) {
        EXPECT_LE(sharpest(light, t), std::cos(22.0 * kPi / 180.0) + 1e-4);
        constexpr int kSteps = 8;
        for (int i = 0; i <= kSteps; ++i)
            for (int j = 0; i + j <= kSteps; ++j) {
                const Vec3 p = (i * light.points[t[0]] + j * light.points[t[1]] +
                                (kSteps - i - j) * light.points[t[2]]) /
                               kSteps;
                EXPECT_LE(std::abs(p.norm() - 1.0), kTolerance + 1e-9);
            }
    }
    for (const Vec3& p : mesh.points) EXPECT_LE(support::distance_to_mesh(p, light), kTolerance + 1e-6);
}

TEST(Lightening, KeepsVerticesThatMayNotGo) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const TriangleMesh mesh = support::icosphere(3);
    const CrossingGrid nothing(std::vector<Surface::Crossing>{}, 0.1);
    std::vector<char> may_go;
    for (const Vec3& p : mesh.points) may_go.push_back(p.z() > 0.3);
    const TriangleMesh light = lightened(mesh, may_go, *sphere, nothing, 0.02);
    expect_sound(light);
    const std::set<int> left = used(light);
    EXPECT_LT(left.size(), mesh.points.size() - 50);
    for (std::size_t v = 0; v < may_go.size(); ++v)
        EXPECT_TRUE(may_go[v] || left.count(static_cast<int>(v)) == 1) << v;
}

TEST(Lightening, KeepsToleranceTopologyAndGapsOfALatticeMesh) {
    // Two plates with a gap of less than two voxels between them, a ring, and a drop.
    constexpr double kVoxel = 0.06, kTolerance = 2.5 * kVoxel;
    const auto shape = shapes::unite({shapes::box({0, 0, -0.12}, {0.9, 0.7, 0.14}, kVoxel),
                                      shapes::box({0, 0, 0.12}, {0.9, 0.7, 0.14}, kVoxel),
                                      shapes::torus({0, 0, 0.8}, 0.5, 0.12, kVoxel),
                                      shapes::sphere({1.1, 0, 0.6}, 0.08, kVoxel)});
    const LevelSet surface(rasterise(*shape, kVoxel));
    const TriangleMesh mesh = surface.lattice_mesh({Vec3::Zero()}, 10.0);
    expect_sound(mesh);
    const CrossingGrid reached(surface);
    const TriangleMesh light =
        lightened(mesh, std::vector<char>(mesh.points.size(), 1), surface, reached, kTolerance);
    expect_sound(light);
    const MeshTopology before = mesh_topology(mesh), after = mesh_topology(light);
    EXPECT_EQ(after.euler, before.euler);
    EXPECT_EQ(after.components, before.components);
    EXPECT_LT(light.triangles.size(), mesh.triangles.size() / 8);
    for (std::size_t i = 0; i < reached.size(); ++i)
        EXPECT_LE(support::distance_to_mesh(reached[i].point, light), kTolerance + 1e-6);
}

TEST(Lightening, IsTheSameAtAnyThreadCount) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const TriangleMesh mesh = support::icosphere(4);
    const CrossingGrid nothing(std::vector<Surface::Crossing>{}, 0.1);
    // Twenty-four patches, of whose boxes most meet, and twenty-eight that are apart.
    for (const double least : {0.3, 0.6}) {
        std::vector<char> may_go;
        for (const Vec3& p : mesh.points)
            may_go.push_back(std::sin(9.0 * p.x()) * std::sin(9.0 * p.y()) > least);
        const auto by = [&](int threads) {
            const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
            return lightened(mesh, may_go, *sphere, nothing, 0.02).triangles;
        };
        const auto alone = by(1);
        EXPECT_LT(alone.size(), mesh.triangles.size() - 100);
        for (int turn = 0; turn < 5; ++turn) EXPECT_EQ(by(4), alone);
    }
}

TEST(Lightening, LeavesATetrahedronAlone) {
    const TriangleMesh mesh = support::tetrahedron();
    const auto sphere = shapes::sphere({0.25, 0.25, 0.25}, 0.5, 0.2);
    const CrossingGrid nothing(std::vector<Surface::Crossing>{}, 0.1);
    EXPECT_EQ(lightened(mesh, {1, 1, 1, 1}, *sphere, nothing, 10.0).triangles, mesh.triangles);
}

}  // namespace
}  // namespace isotrack
