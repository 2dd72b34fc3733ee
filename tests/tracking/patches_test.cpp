// Patches on meshes whose faults are known.
#include "tracking/patches.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/shapes.h"
#include "support/carved.h"
#include "support/lattice_grid.h"
#include "tracking/light_patches.h"
#include "tracking/patch_batches.h"

namespace isotrack {
namespace {

using support::Carved;
using support::Inspected;
using support::lattice_grid;
using support::topology_of;

/// A disk of one layer of lattice nodes, which are inside by little: about a third of a voxel thick. Beside
/// it a ball, so that the values inside are known for distances.
openvdb::FloatGrid::Ptr thin_disk_and_ball() {
    return lattice_grid({-13, -13, -9}, {26, 13, 9}, [](const Vec3& p) {
        const double disk = std::max(std::abs(p.z()) - 0.15, std::hypot(p.x() + 0.1, p.y() - 0.2) - 8.3);
        return std::min(disk, (p - Vec3(18.2, 0.1, 0.3)).norm() - 5.3);
    });
}

void expect_sound(const FrameMesh& mesh) {
    const MeshTopology topology = topology_of(mesh);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_TRUE(self_intersections(mesh.vertices, mesh.carved.triangles).empty());
}

/// Takes cells near a place out of a surface's mesh, which gets that other Euler number, then patches it.
void expect_patched(const openvdb::FloatGrid::Ptr& grid, const Vec3& place, double radius, long without) {
    const LevelSet surface(grid);
    const auto euler = surface.lattice_euler();
    const auto components = surface.lattice_components();
    ASSERT_TRUE(euler && components);
    Carved carved(surface, 0.5, 0.8);
    ASSERT_EQ(topology_of(carved.mesh()).euler, *euler);
    for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
        if (carved.labels[c] && (carved.centroid(c) - place).norm() < radius) carved.labels[c] = 0;
    FrameMesh mesh = carved.mesh();
    ASSERT_EQ(topology_of(mesh).euler, without);
    ASSERT_EQ(topology_of(mesh).components, components->size());

    Inspected now(carved, mesh);
    const std::vector<double> thickness(carved.particles.size(), 0.3);
    EXPECT_EQ(patch_topology(now.trials, thickness, surface), 1u);
    const MeshTopology topology = topology_of(mesh);
    EXPECT_EQ(topology.euler, *euler);
    EXPECT_EQ(topology.components, components->size());
    expect_sound(mesh);
    EXPECT_EQ(mesh.carved.particle.size(), mesh.vertices.size());
    EXPECT_EQ(mesh.carved.facet.size(), mesh.carved.triangles.size());
    // Now there is nothing to patch.
    EXPECT_EQ(patch_topology(now.trials, thickness, surface), 0u);

    const FrameMesh patched = mesh;
    const std::size_t failing = now.trials.failing_places().size();
    const std::size_t went = lighten_patches(now.trials, surface, carved.limits);
    EXPECT_GT(went, 10u);
    EXPECT_EQ(mesh.vertices.size(), patched.vertices.size() - went);
    const auto on_particles = [](const FrameMesh& of) {
        return std::count_if(of.carved.particle.begin(), of.carved.particle.end(),
                             [](int p) { return p >= 0; });
    };
    EXPECT_EQ(on_particles(mesh), on_particles(patched));
    EXPECT_EQ(unfitted_vertices(mesh.carved, carved.particles.position), mesh.vertices);
    expect_sound(mesh);
    EXPECT_EQ(topology_of(mesh).euler, *euler);
    EXPECT_EQ(topology_of(mesh).components, components->size());
    EXPECT_LE(now.trials.failing_places().size(), failing);
    EXPECT_EQ(now.inspection.errors->size(), mesh.carved.triangles.size());
}

TEST(Patches, FillAHoleInAThinSheet) {
    expect_patched(thin_disk_and_ball(), {0.5, 0.5, 0.0}, 0.6, 2);
}

/// A ring of about a voxel and a half across.
openvdb::FloatGrid::Ptr thin_ring() {
    return lattice_grid({-13, -13, -6}, {13, 13, 6}, [](const Vec3& p) {
        return std::hypot(std::hypot(p.x() + 0.2, p.y() - 0.1) - 7.3, p.z() + 0.1) - 0.85;
    });
}

TEST(Patches, FillManyHolesAtOnce) {
    const LevelSet surface(thin_disk_and_ball());
    Carved carved(surface, 0.5, 0.8);
    const MeshTopology whole = topology_of(carved.mesh());
    const std::vector<Vec3> holes = {{0.5, 0.5, 0.0}, {-5.0, 0.3, 0.0}, {4.6, -2.2, 0.0}, {0.2, 5.4, 0.0}};
    for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
        if (carved.labels[c] && std::any_of(holes.begin(), holes.end(), [&](const Vec3& hole) {
                return (carved.centroid(c) - hole).norm() < 1.3;
            }))
            carved.labels[c] = 0;
    FrameMesh mesh = carved.mesh();
    ASSERT_NE(topology_of(mesh).euler, whole.euler);

    Inspected now(carved, mesh);
    const auto fails_near = [&](const Vec3& hole) {
        const auto failing = now.trials.failing_places();
        return std::any_of(failing.begin(), failing.end(),
                           [&](const Vec3& place) { return (place - hole).norm() < 1.6; });
    };
    for (const Vec3& hole : holes) EXPECT_TRUE(fails_near(hole)) << hole.transpose();
    const std::size_t failing_before = now.trials.failing_places().size();
    EXPECT_GE(mend_in_batches(now.trials, surface), holes.size());
    for (const Vec3& hole : holes) EXPECT_FALSE(fails_near(hole)) << hole.transpose();
    EXPECT_LT(now.trials.failing_places().size(), failing_before);
    const MeshTopology topology = topology_of(mesh);
    EXPECT_EQ(topology.euler, whole.euler);
    EXPECT_EQ(topology.components, whole.components);
    expect_sound(mesh);
    EXPECT_EQ(now.inspection.errors->size(), mesh.carved.triangles.size());
}

TEST(Patches, CloseARingThatIsCut) {
    expect_patched(thin_ring(), {7.0, 0.0, 0.0}, 0.9, 2);
}

double to_balls(const Vec3& p) {
    const double ball = (p - Vec3(0.1, 0.2, 0.3)).norm() - 5.3, drop = (p - Vec3(8.1, 0.4, 0.6)).norm() - 1.3;
    return std::min(ball, drop);
}
double to_balls_and_another(const Vec3& p) {
    return std::min(to_balls(p), (p - Vec3(-8.1, 0.2, 0.1)).norm() - 1.3);
}

template <typename Distance>
openvdb::FloatGrid::Ptr grid_of(const Distance& distance) {
    return lattice_grid({-12, -9, -9}, {12, 9, 9}, distance);
}

TEST(Patches, PartADropFromABallWhereNoNodeTellsThemApart) {
    // In the mesh a tube between the lattice lines joins them. The other drop is not in it: that, which
    // patches do not mend, is what draws attention.
    const auto joined = shapes::from_function(
        [](const Vec3& p) {
            const double tube = std::hypot(p.y() - 0.5, p.z() - 0.5) - 0.3;
            return std::min(to_balls(p), std::max({tube, 4.0 - p.x(), p.x() - 8.0}));
        },
        Box(Vec3(-7, -7, -7), Vec3(11, 7, 7)), 0.25);
    const Carved carved(*joined, 0.5, 0.3);
    FrameMesh mesh = carved.mesh();
    ASSERT_EQ(topology_of(mesh).components, 1u);
    ASSERT_EQ(topology_of(mesh).euler, 2);

    const LevelSet surface(grid_of(to_balls_and_another));
    Inspected now(surface, carved.limits, mesh);
    for (const Vec3& fault : now.inspection.topology.faults) EXPECT_LT(fault.x(), -6.0);
    patch_topology(now.trials, std::vector<double>(carved.particles.size(), 9.0), surface);
    EXPECT_EQ(topology_of(mesh).components, 2u);
    EXPECT_EQ(topology_of(mesh).euler, 4);
    for (const Vec3& v : mesh.vertices) EXPECT_LT(std::abs(to_balls(v)), 0.3);
    expect_sound(mesh);
}

TEST(Patches, AreTheSameAtAnyNumberOfThreads) {
    const LevelSet surface(thin_disk_and_ball());
    const auto patched = [&](std::size_t threads) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        Carved carved(surface, 0.5, 0.8);
        for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
            if (carved.labels[c] && (carved.centroid(c) - Vec3(0.5, 0.5, 0.0)).norm() < 0.6)
                carved.labels[c] = 0;
        FrameMesh mesh = carved.mesh();
        Inspected now(carved, mesh);
        patch_topology(now.trials, std::vector<double>(carved.particles.size(), 0.3), surface);
        return mesh;
    };
    const FrameMesh one = patched(1), two = patched(2);
    EXPECT_EQ(one.vertices, two.vertices);
    EXPECT_EQ(one.carved.triangles, two.carved.triangles);
}

TEST(Patches, MendWhatIsTooFarOffAndLeaveTheRest) {
    const LevelSet surface(grid_of(to_balls));
    const Carved carved(surface, 0.5, 0.8);
    FrameMesh mesh = carved.mesh();
    const FrameMesh before = mesh;
    const auto dent = std::max_element(mesh.vertices.begin(), mesh.vertices.end(),
                                       [](const Vec3& a, const Vec3& b) { return a.y() < b.y(); });
    *dent -= Vec3(0.0, 0.9, 0.0);
    const Vec3 place = *dent;
    const MeshTopology topology = topology_of(mesh);
    Inspected now(carved, mesh);
    const std::vector<double> thickness(carved.particles.size(), 9.0);
    ASSERT_FALSE(now.trials.failing_places().empty());
    EXPECT_GT(patch_failing(now.trials, thickness, surface), 0u);

    EXPECT_TRUE(now.trials.failing_places().empty());
    for (const auto& [i, j, k] : mesh.carved.triangles)
        for (const Vec3& p : {mesh.vertices[i], Vec3(0.5 * (mesh.vertices[i] + mesh.vertices[j])),
                              Vec3((mesh.vertices[i] + mesh.vertices[j] + mesh.vertices[k]) / 3.0)})
            EXPECT_LT(std::abs(to_balls(p)), 0.5);
    EXPECT_EQ(topology_of(mesh).components, topology.components);
    EXPECT_EQ(topology_of(mesh).euler, topology.euler);
    expect_sound(mesh);
    const auto has = [](const FrameMesh& some, const Vec3& v) {
        return std::find(some.vertices.begin(), some.vertices.end(), v) != some.vertices.end();
    };
    for (const Vec3& v : before.vertices) EXPECT_TRUE((v - place).norm() < 4.0 || has(mesh, v));
    // Now there is nothing to mend.
    EXPECT_EQ(patch_failing(now.trials, thickness, surface), 0u);
}

TEST(Patches, MendWhatIsTurnedOver) {
    const LevelSet surface(grid_of(to_balls));
    const Carved carved(surface, 0.5, 0.8);
    FrameMesh mesh = carved.mesh();
    const auto top = std::max_element(mesh.vertices.begin(), mesh.vertices.end(),
                                      [](const Vec3& a, const Vec3& b) { return a.y() < b.y(); });
    // Along the surface past its neighbours: nothing is farther off.
    *top = *surface.probe()->project(*top + Vec3(2.0, -0.3, 0.3));
    Inspected now(carved, mesh);
    ASSERT_TRUE(now.inspection.missed.empty());
    ASSERT_FALSE(now.trials.failing_places().empty());
    TrackedFrame frame;
    frame.tolerance = 0.5;
    report(mesh, now.inspection, surface, frame);
    EXPECT_LE(frame.max_error, 0.5);
    EXPECT_GE(frame.most_turned_deg, kTurnedOverDeg);
    EXPECT_FALSE(frame.within_tolerance);

    EXPECT_GT(patch_failing(now.trials, std::vector<double>(carved.particles.size(), 9.0), surface), 0u);
    EXPECT_TRUE(now.trials.failing_places().empty());
    expect_sound(mesh);
    const Vec3 middle(0.1, 0.2, 0.3);
    for (const auto& [i, j, k] : mesh.carved.triangles) {
        const Vec3 &a = mesh.vertices[i], &b = mesh.vertices[j], &c = mesh.vertices[k];
        const Vec3 area = (b - a).cross(c - a);
        const bool is_high = area.norm() > 0.5 * std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
        EXPECT_TRUE((a - middle).norm() > 6.0 || !is_high || area.dot(a - middle) > 0.0);
    }
    TrackedFrame mended;
    mended.tolerance = 0.5;
    report(mesh, now.inspection, surface, mended);
    EXPECT_TRUE(mended.within_tolerance);
}

}  // namespace
}  // namespace isotrack
