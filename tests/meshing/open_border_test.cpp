// Surfaces that run into the border of their grid: closed by a cap, or open.
#include "isotrack/meshing/open_border.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <set>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/tracking/tracker.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

constexpr double kVoxel = 0.05, kCut = 0.3;  // the border is between the voxels at 0.3 and beyond

/// A unit sphere of which everything beyond x = 0.3 is not in the grid. `dense`: a block of voxels with
/// background zero, else a band of three voxels with tiles inside.
openvdb::FloatGrid::Ptr cut_sphere(bool dense) {
    const float background = dense ? 0.0f : static_cast<float>(3.0 * kVoxel);
    auto grid = openvdb::FloatGrid::create(background);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(kVoxel));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto access = grid->getAccessor();
    const int n = 26, cut = static_cast<int>(std::lround(kCut / kVoxel));
    for (int x = -n; x <= cut; ++x)
        for (int y = -n; y <= n; ++y)
            for (int z = -n; z <= n; ++z) {
                const float value =
                    static_cast<float>(kVoxel * std::sqrt(double(x * x + y * y + z * z)) - 1.0);
                const openvdb::Coord c(x, y, z);
                if (dense || std::abs(value) < background)
                    access.setValue(c, value);
                else if (value < 0.0f)
                    access.setValueOff(c, -background);
            }
    return grid;
}

TrackedFrame mesh_of(const Surface& surface, Border border) {
    TrackerOptions options;
    options.tolerance = 0.5 * kVoxel;
    options.border = border;
    Tracker tracker(options);
    return tracker.advance(surface);
}

/// Of the unit ball below x = at.
double volume_below(double at) {
    return std::acos(-1.0) * (at - at * at * at / 3.0 + 2.0 / 3.0);
}

TEST(Border, IsClosedByAFlatCapByDefault) {
    for (const bool dense : {false, true}) {
        const LevelSet surface(cut_sphere(dense));
        EXPECT_GT(surface.border_crossings(), 0u);
        const TrackedFrame frame = mesh_of(surface, Border::Close);
        const MeshTopology topology = mesh_topology(frame.mesh);
        EXPECT_TRUE(topology.closed() && topology.manifold() && topology.oriented());
        EXPECT_EQ(topology.components, 1u);
        EXPECT_EQ(topology.euler, 2);
        EXPECT_FALSE(frame.opened);
        EXPECT_TRUE(frame.within_tolerance);
        // The cap is between the last voxels and the first that are missing.
        const double volume = enclosed_volume(frame.mesh);
        EXPECT_GT(volume, 0.98 * volume_below(kCut));
        EXPECT_LT(volume, 1.01 * volume_below(kCut + kVoxel));
        for (const Vec3& p : frame.mesh.points) EXPECT_LT(p.x(), kCut + 1.001 * kVoxel);
    }
}

TEST(Border, LeftOpenHasOneLoopAtTheBorder) {
    for (const bool dense : {false, true}) {
        const LevelSet surface(cut_sphere(dense));
        const TrackedFrame closed = mesh_of(surface, Border::Close), open = mesh_of(surface, Border::Open);
        const MeshTopology topology = mesh_topology(open.mesh);
        EXPECT_TRUE(open.opened);
        EXPECT_TRUE(topology.manifold() && topology.oriented());
        EXPECT_EQ(topology.unused_vertices, 0u);
        EXPECT_EQ(topology.components, 1u);
        EXPECT_EQ(topology.euler, 1);  // a disk
        EXPECT_GT(topology.border_edges, 10u);
        // The rest is as it was, vertex by vertex.
        std::set<std::array<double, 3>> before;
        for (const Vec3& p : closed.mesh.points) before.insert({p.x(), p.y(), p.z()});
        for (const Vec3& p : open.mesh.points) EXPECT_EQ(before.count({p.x(), p.y(), p.z()}), 1u);
        // No triangle far from the border went, none in the middle of the cap stayed.
        std::size_t away_closed = 0, away_open = 0;
        for (const auto& [mesh, count] :
             {std::pair(&closed.mesh, &away_closed), std::pair(&open.mesh, &away_open)})
            for (const Triangle& t : mesh->triangles) {
                const Vec3 middle = (mesh->points[t[0]] + mesh->points[t[1]] + mesh->points[t[2]]) / 3.0;
                *count += middle.x() < kCut - kVoxel;
                if (mesh == &open.mesh) {
                    EXPECT_GT(middle.norm(), 0.9);
                }
            }
        EXPECT_EQ(away_open, away_closed);
        std::set<Id> ids(open.mesh.ids.begin(), open.mesh.ids.end());
        EXPECT_EQ(ids.size(), open.mesh.points.size());
    }
}

TEST(Border, OfAClosedSurfaceIsNowhere) {
    const auto grid = openvdb::FloatGrid::create(static_cast<float>(3.0 * kVoxel));
    grid->setTransform(openvdb::math::Transform::createLinearTransform(kVoxel));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto access = grid->getAccessor();
    for (int x = -14; x <= 14; ++x)
        for (int y = -14; y <= 14; ++y)
            for (int z = -14; z <= 14; ++z) {
                const double value = kVoxel * std::sqrt(double(x * x + y * y + z * z)) - 0.5;
                if (std::abs(value) < 3.0 * kVoxel)
                    access.setValue({x, y, z}, static_cast<float>(value));
                else if (value < 0.0)
                    access.setValueOff({x, y, z}, static_cast<float>(-3.0 * kVoxel));
            }
    const LevelSet surface(grid);
    const TrackedFrame closed = mesh_of(surface, Border::Close), open = mesh_of(surface, Border::Open);
    EXPECT_FALSE(open.opened);
    EXPECT_EQ(open.mesh.triangles, closed.mesh.triangles);
}

TEST(OpenBorder, CopiesAVertexWhoseFansFallApart) {
    // Of the triangles around a vertex of an icosahedron two that are not neighbours go.
    TriangleMesh mesh = support::icosphere(0);
    for (std::size_t v = 0; v < mesh.points.size(); ++v) mesh.ids.push_back(static_cast<Id>(v));
    const std::vector<Triangle> all = mesh.triangles;
    const int top = all[0][0];
    std::vector<Triangle> around;
    for (const Triangle& t : all)
        if (t[0] == top || t[1] == top || t[2] == top) around.push_back(t);
    ASSERT_EQ(around.size(), 5u);
    Triangle apart{};
    for (const Triangle& t : around) {
        std::set<int> common(t.begin(), t.end());
        int shared = 0;
        for (const int v : around[0]) shared += static_cast<int>(common.count(v));
        if (shared == 1) apart = t;
    }
    // One flagged triangle at a time, so that no other has all its vertices flagged.
    Id next_id = 100;
    for (const Triangle& t : {around[0], apart}) {
        std::vector<char> flags(mesh.points.size(), 0);
        for (std::size_t v = 0; v < mesh.points.size(); ++v)
            for (const int corner : t) flags[v] = flags[v] || mesh.ids[v] == corner;
        EXPECT_EQ(open_border(mesh, flags, next_id), 1u);
    }
    const MeshTopology topology = mesh_topology(mesh);
    EXPECT_EQ(topology.triangles, all.size() - 2);
    EXPECT_TRUE(topology.manifold() && topology.oriented());
    EXPECT_EQ(topology.vertices, 13u);
    EXPECT_EQ(next_id, 101);
}

}  // namespace
}  // namespace isotrack
