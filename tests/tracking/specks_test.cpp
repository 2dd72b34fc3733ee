// Specks that are joined or removed, drops that are put in.
#include "tracking/specks.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "support/carved.h"
#include "support/lattice_grid.h"
#include "tracking/lost_drops.h"

namespace isotrack {
namespace {

using support::Carved;
using support::Inspected;
using support::lattice_grid;
using support::topology_of;

double to_ball(const Vec3& p) {
    return (p - Vec3(0.2, 0.1, 0.3)).norm() - 5.3;
}

/// A ball with a spike of one line of nodes.
openvdb::FloatGrid::Ptr ball_with_spike() {
    return lattice_grid({-9, -9, -9}, {16, 9, 9}, [](const Vec3& p) {
        const double spike = std::max({std::hypot(p.y(), p.z()) - 0.45, 2.0 - p.x(), p.x() - 12.2});
        return std::min(spike, to_ball(p));
    });
}

/// Of the ball with its spike cut through at some places: joins specks at this tolerance, then removes what
/// is left.
void cut_a_spike(const std::vector<double>& at, double tolerance, std::size_t joined, bool reaches_its_end) {
    const LevelSet surface(ball_with_spike());
    Carved carved(surface, tolerance, 0.3);
    ASSERT_EQ(topology_of(carved.mesh()).components, 1u);
    ASSERT_EQ(topology_of(carved.mesh()).euler, 2);
    for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
        for (const double x : at)
            if (carved.labels[c] && std::abs(carved.centroid(c).x() - x) < 0.5) carved.labels[c] = 0;
    FrameMesh mesh = carved.mesh();
    ASSERT_GT(topology_of(mesh).components, 1u);

    Inspected now(carved, mesh);
    for (std::size_t t = 0; t < mesh.carved.triangles.size(); ++t) {
        const double x = mesh.vertices[mesh.carved.triangles[t][0]].x();
        if (x > 8.5 && x < 10.5) continue;
        EXPECT_EQ(now.inspection.topology.speck[t] != 0, x > 9.5);
    }
    EXPECT_EQ(join_specks(now.trials, carved.labels, carved.carve_labels(), carved.cells, carved.particles,
                          surface, carved.limits),
              joined);
    remove_specks(mesh, now.inspection, now.inspector, carved.limits);
    EXPECT_EQ(topology_of(mesh).components, 1u);
    EXPECT_EQ(topology_of(mesh).euler, 2);
    EXPECT_TRUE(topology_of(mesh).closed() && topology_of(mesh).manifold());
    EXPECT_TRUE(now.inspection.missed.empty());
    EXPECT_EQ(
        std::any_of(mesh.vertices.begin(), mesh.vertices.end(), [](const Vec3& p) { return p.x() > 11.9; }),
        reaches_its_end);
}

TEST(Specks, AreJoinedWhereSomethingWouldBeMissedWithoutThem) {
    cut_a_spike({9.5}, 0.5, 1, true);
    cut_a_spike({9.5, 11.2}, 0.5, 2, true);
}

TEST(Specks, AreRemovedWhereNothingIsMissedWithoutThem) {
    cut_a_spike({9.5}, 5.0, 0, false);
}

/// A ball, and beside it nodes that are inside by little: one alone and two in a row.
openvdb::FloatGrid::Ptr ball_and_single_nodes() {
    const auto grid = lattice_grid({-9, -9, -9}, {18, 9, 9}, to_ball);
    auto values = grid->getAccessor();
    values.setValue({9, 0, 0}, -0.01f);
    values.setValue({13, 2, 0}, -0.02f);
    values.setValue({13, 3, 0}, -0.3f);
    return grid;
}

TEST(LostDrops, ArePutInWhereTheMeshHasNothingOfThem) {
    const LevelSet surface(ball_and_single_nodes());
    Carved carved(surface, 0.5, 0.5);
    for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
        if ((carved.centroid(c) - Vec3(0.2, 0.1, 0.3)).norm() > 5.28) carved.labels[c] = 0;
    FrameMesh mesh = carved.mesh();
    const MeshTopology before = topology_of(mesh);
    const std::size_t vertices = mesh.vertices.size();

    Inspected now(carved, mesh);
    const auto lost = now.inspection.topology.lost;
    ASSERT_EQ(lost.size(), 2u);
    EXPECT_EQ(lost[0].size() + lost[1].size(), 3u);
    EXPECT_TRUE(put_in_drops(lost, mesh, now.inspection, now.inspector, surface));
    const MeshTopology then = topology_of(mesh);
    EXPECT_EQ(then.components, before.components + 2);
    EXPECT_EQ(then.euler, before.euler + 4);
    EXPECT_TRUE(then.closed() && then.oriented() && then.manifold());
    EXPECT_TRUE(self_intersections(mesh.vertices, mesh.carved.triangles).empty());
    EXPECT_EQ(now.inspection.errors->size(), mesh.carved.triangles.size());
    EXPECT_EQ(std::count(mesh.carved.particle.begin(), mesh.carved.particle.end(), -1),
              static_cast<std::ptrdiff_t>(mesh.carved.midpoints.size()));
    EXPECT_EQ(mesh.carved.particle.size(), mesh.vertices.size());
    for (std::size_t v = vertices; v < mesh.vertices.size(); ++v) {
        EXPECT_EQ(mesh.carved.particle[v], -1);
        EXPECT_LT(std::abs(surface.probe()->value(mesh.vertices[v])), 0.2);
    }
    now.inspector.inspect_topology(mesh, now.inspection);
    EXPECT_TRUE(now.inspection.topology.lost.empty());
    EXPECT_FALSE(put_in_drops({}, mesh, now.inspection, now.inspector, surface));
}

TEST(LostDrops, AreLeftOutWhereTheyWouldCrossTheMesh) {
    const LevelSet surface(ball_and_single_nodes());
    Carved carved(surface, 0.5, 0.5);
    FrameMesh mesh = carved.mesh();
    Inspected now(carved, mesh);
    // Through a vertex of the mesh, so that every size of drop would cross it.
    const auto at_vertex =
        std::min_element(mesh.vertices.begin(), mesh.vertices.end(), [](const Vec3& a, const Vec3& b) {
            const auto off = [](const Vec3& p) { return (p - Vec3(p.array().round())).norm(); };
            return off(a) < off(b);
        });
    const Vec3 node = at_vertex->array().round();
    const Vec3 shift = node - *at_vertex;
    for (Vec3& v : mesh.vertices) v += shift;
    const std::size_t before = mesh.carved.triangles.size();
    EXPECT_FALSE(put_in_drops({{node}}, mesh, now.inspection, now.inspector, surface));
    EXPECT_EQ(mesh.carved.triangles.size(), before);
    EXPECT_EQ(mesh.vertices.size(), mesh.carved.particle.size());
}

}  // namespace
}  // namespace isotrack
