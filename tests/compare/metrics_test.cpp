#include "isotrack/compare/metrics.h"

#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "isotrack/compare/baselines.h"
#include "isotrack/error.h"
#include "isotrack/meshing/certify.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

LevelSet sphere_level_set(double radius, double voxel, const Vec3& centre = Vec3::Zero()) {
    return LevelSet(openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(
        static_cast<float>(radius), openvdb::Vec3f(openvdb::Vec3d(centre.x(), centre.y(), centre.z())),
        static_cast<float>(voxel)));
}

/// How deep the planes of an icosphere's facets lie under the sphere: largest, and root mean square over the
/// area when the depth under a facet falls off as on a flat equilateral triangle: sqrt(0.6) of its largest.
struct Sagitta {
    double largest = 0.0, rms = 0.0;
};

Sagitta sagitta(const TriangleMesh& mesh, double radius) {
    Sagitta result;
    double area = 0.0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3 normal =
            (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]);
        const double depth = radius - mesh.points[t[0]].dot(normal.normalized());
        result.largest = std::max(result.largest, depth);
        result.rms += 0.6 * depth * depth * normal.norm();
        area += normal.norm();
    }
    result.rms = std::sqrt(result.rms / area);
    return result;
}

TEST(Measure, FindsTheErrorOfAnIcosphereBothWays) {
    constexpr double kRadius = 1.0, kVoxel = 0.01;
    const TriangleMesh mesh = support::icosphere(3, Vec3::Zero(), kRadius);
    const Sagitta truth = sagitta(mesh, kRadius);
    const MeshMetrics m = measure(mesh, sphere_level_set(kRadius, kVoxel));
    // Trilinear interpolation adds voxel / (6 radius) voxels; no lattice point need be at the deepest place.
    const double slack = kVoxel / kRadius / 3.0 + 0.02 * truth.largest / kVoxel;
    EXPECT_GT(truth.largest / kVoxel, 0.4);
    EXPECT_NEAR(m.to_max, truth.largest / kVoxel, slack);
    EXPECT_NEAR(m.from_max, truth.largest / kVoxel, slack);
    EXPECT_NEAR(m.from_rms, truth.rms / kVoxel, 0.02 * truth.rms / kVoxel);
    // The corners, where the error is none, are more of the 28 points than of the area.
    EXPECT_LT(m.to_rms, truth.rms / kVoxel);
    EXPECT_GT(m.to_rms, 0.85 * truth.rms / kVoxel);
    EXPECT_EQ(m.error_max(), std::max(m.to_max, m.from_max));
    EXPECT_TRUE(m.topology.closed() && m.topology.manifold() && m.topology.oriented());
    EXPECT_EQ(m.topology.genus(), 0);
    EXPECT_EQ(m.self_intersections, 0u);
    EXPECT_NEAR(m.volume, 4.0 / 3.0 * std::acos(-1.0), 0.05);
    EXPECT_LT(m.normal_max_deg, 1.0);
    EXPECT_LE(m.normal_mean_deg, m.normal_max_deg);
    EXPECT_GT(m.min_angle_deg, 50.0);
    EXPECT_LE(m.min_angle_deg, m.angle_p1_deg);
    EXPECT_LE(m.angle_p1_deg, m.mean_min_angle_deg);
}

TEST(Measure, FindsAMeshThatIsTooLarge) {
    constexpr double kVoxel = 0.02;
    const MeshMetrics m = measure(support::icosphere(5, Vec3(3, 2, 1), 1.0 + 1.5 * kVoxel),
                                  sphere_level_set(1.0, kVoxel, Vec3(3, 2, 1)));
    EXPECT_NEAR(m.to_max, 1.5, 0.02);
    EXPECT_NEAR(m.to_rms, 1.5, 0.03);
    EXPECT_NEAR(m.from_max, 1.5, 0.02);
    EXPECT_NEAR(m.from_rms, 1.5, 0.03);
}

TEST(Measure, SeesAMissingTriangleFromTheLevelSetOnly) {
    constexpr double kVoxel = 0.01;
    const LevelSet level_set = sphere_level_set(1.0, kVoxel);
    TriangleMesh mesh = support::icosphere(2);
    const MeshMetrics whole = measure(mesh, level_set);
    const Triangle hole = mesh.triangles[100];
    mesh.triangles.erase(mesh.triangles.begin() + 100);
    const MeshMetrics m = measure(mesh, level_set);
    EXPECT_EQ(m.topology.border_edges, 3u);
    EXPECT_NEAR(m.to_max, whole.to_max, 1e-12);

    // Farthest from the border is the sphere above the middle of the hole.
    const Vec3 &a = mesh.points[hole[0]], &b = mesh.points[hole[1]], &c = mesh.points[hole[2]];
    const double perimeter = (a - b).norm() + (b - c).norm() + (c - a).norm();
    const Vec3 normal = (b - a).cross(c - a);
    const double in_radius = normal.norm() / perimeter, depth = 1.0 - a.dot(normal.normalized());
    EXPECT_NEAR(m.from_max, std::hypot(in_radius, depth) / kVoxel, 0.7);  // crossings are up to a voxel apart
    EXPECT_GT(m.from_max, 3.0 * whole.from_max);
}

TEST(Measure, SeesAMissingComponentFromTheLevelSetOnly) {
    constexpr double kVoxel = 0.02;
    const auto near = shapes::sphere(Vec3::Zero(), 0.5, kVoxel),
               far = shapes::sphere(Vec3(2, 0, 0), 0.3, kVoxel);
    const LevelSet level_set(rasterise(*shapes::unite({near, far}), kVoxel));
    const TriangleMesh first = support::icosphere(5, Vec3::Zero(), 0.5),
                       second = support::icosphere(5, Vec3(2, 0, 0), 0.3);
    const MeshMetrics one = measure(first, level_set);
    EXPECT_NEAR(one.from_max, (2.0 + 0.3 - 0.5) / kVoxel, 0.1);
    EXPECT_LT(one.to_max, 0.1);
    const MeshMetrics both = measure(support::join(first, second), level_set);
    EXPECT_LT(both.from_max, 0.1);
    EXPECT_EQ(both.topology.components, 2u);
}

TEST(Measure, SeesANormalTheWrongWayRound) {
    TriangleMesh mesh = support::icosphere(4);
    for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
    const MeshMetrics m = measure(mesh, sphere_level_set(1.0, 0.02));
    EXPECT_GT(m.normal_mean_deg, 179.0);
    EXPECT_LT(m.volume, 0.0);
}

TEST(Measure, TreatsEmptyMeshesAndEmptyLevelSets) {
    const LevelSet sphere = sphere_level_set(1.0, 0.05);
    const MeshMetrics none = measure({}, sphere);
    EXPECT_EQ(none.from_max, std::numeric_limits<double>::infinity());
    EXPECT_EQ(none.from_rms, std::numeric_limits<double>::infinity());
    EXPECT_EQ(none.to_max, 0.0);
    EXPECT_EQ(none.min_angle_deg, 0.0);
    const openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0.15f);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.05));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    EXPECT_EQ(measure({}, LevelSet(grid)).error_max(), 0.0);
    EXPECT_EQ(measure(support::tetrahedron(), LevelSet(grid)).from_max, 0.0);
}

TEST(Measure, RefusesBrokenMeshes) {
    TriangleMesh mesh = support::tetrahedron();
    mesh.triangles[0][0] = 9;
    EXPECT_THROW(measure(mesh, sphere_level_set(1.0, 0.1)), InputError);
}

// volumeToMesh's adaptive meshes have slivers, doubled points and triangles without area.
TEST(Measure, AgreesWithDistancesToEveryTriangle) {
    const auto torus = shapes::torus(Vec3(0.1, 0.2, 0.3), 0.5, 0.2, 0.03);
    const LevelSet level_set(rasterise(*torus, 0.03));
    const TriangleMesh mesh = volume_to_mesh(level_set, 0.6);
    const auto probe = level_set.probe();
    auto crossings = level_set.crossings();
    for (auto& c : crossings) {
        c.point = probe->project(c.point).value_or(c.point);
        c.outward.setZero();  // the nearest triangle, whichever way it faces
    }
    double largest = 0.0, squares = 0.0;
    for (const double d : crossing_distances(mesh.points, mesh.triangles, CrossingGrid(crossings, 0.06), 1.0)) {
        largest = std::max(largest, d);
        squares += d * d;
    }
    const MeshMetrics m = measure(mesh, level_set);
    EXPECT_NEAR(m.from_max, largest / 0.03, 1e-6);
    EXPECT_NEAR(m.from_rms, std::sqrt(squares / static_cast<double>(crossings.size())) / 0.03, 1e-6);
}

TEST(Measure, HasTheSameBitsAtAnyThreadCount) {
    const LevelSet level_set = sphere_level_set(1.0, 0.03);
    const TriangleMesh mesh = volume_to_mesh(level_set, 0.2);
    const MeshMetrics many = measure(mesh, level_set);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    const MeshMetrics one = measure(mesh, level_set);
    EXPECT_EQ(one.to_max, many.to_max);
    EXPECT_EQ(one.to_rms, many.to_rms);
    EXPECT_EQ(one.from_max, many.from_max);
    EXPECT_EQ(one.from_rms, many.from_rms);
    EXPECT_EQ(one.normal_mean_deg, many.normal_mean_deg);
    EXPECT_EQ(one.volume, many.volume);
}

TEST(VolumeToMesh, IsClosedAndOrientedOutwardWhateverTheTransform) {
    const double volume = 4.0 / 3.0 * std::acos(-1.0) * 0.4 * 0.4 * 0.4;
    for (const openvdb::Vec3d scale :
         {openvdb::Vec3d(1, 1, 1), openvdb::Vec3d(-1, 1, 1), openvdb::Vec3d(-1, -1, -1)}) {
        const auto grid =
            openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(0.4f, openvdb::Vec3f(0.5f), 0.02f);
        grid->transform().postScale(scale);
        const LevelSet level_set(grid);
        for (const double adaptivity : {0.0, 0.1}) {
            const TriangleMesh mesh = volume_to_mesh(level_set, adaptivity);
            EXPECT_NEAR(enclosed_volume(mesh), volume, 0.05 * volume);
            EXPECT_TRUE(mesh_topology(mesh).closed());
            EXPECT_TRUE(mesh_topology(mesh).oriented());
        }
    }
}

TEST(VolumeToMesh, SplitsQuadsByTheShorterDiagonal) {
    const LevelSet level_set = sphere_level_set(0.4, 0.02);
    const MeshMetrics m = measure(volume_to_mesh(level_set), level_set);
    EXPECT_EQ(m.topology.genus(), 0);
    EXPECT_LT(m.to_max, 0.1);
    // The longer diagonal leaves triangles far thinner than this.
    EXPECT_GT(m.angle_p1_deg, 20.0);
}

TEST(VolumeToMesh, RefusesAnAdaptivityOutsideItsRange) {
    const LevelSet level_set = sphere_level_set(0.4, 0.05);
    EXPECT_THROW(volume_to_mesh(level_set, -0.1), OptionError);
    EXPECT_THROW(volume_to_mesh(level_set, 1.1), OptionError);
    EXPECT_THROW(volume_to_mesh(level_set, std::numeric_limits<double>::quiet_NaN()), OptionError);
}

}  // namespace
}  // namespace isotrack
