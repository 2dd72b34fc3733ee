#include "meshing/patch.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>

#include "isotrack/compare/baselines.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "meshing/triangle_distance.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

TriangleMesh patched(const TriangleMesh& mesh, const Patch& patch) {
    TriangleMesh result;
    result.points = mesh.points;
    result.points.insert(result.points.end(), patch.points.begin(), patch.points.end());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        if (!patch.gone[t]) result.triangles.push_back(mesh.triangles[t]);
    result.triangles.insert(result.triangles.end(), patch.triangles.begin(), patch.triangles.end());
    return result;
}

void expect_sound(const TriangleMesh& mesh, std::size_t components, long euler) {
    const MeshTopology topology = mesh_topology(mesh);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_EQ(topology.components, components);
    EXPECT_EQ(topology.euler, euler);
    EXPECT_TRUE(self_intersections(mesh).empty());
}

std::optional<Patch> patch_around(const Vec3& place, double reach, const TriangleMesh& mesh,
                                  const TriangleMesh& fine, double spacing) {
    const TriangleBins bins(mesh.points, mesh.triangles, spacing);
    PatchSource source(fine, spacing);
    return patch_for(triangles_around(place, reach, bins), bins, source);
}

TEST(Patch, BringsAFinerPartOfTheSameSphere) {
    const TriangleMesh sphere = support::icosphere(2), fine = support::icosphere(5);
    constexpr double kSpacing = 0.04;
    const double volume = enclosed_volume(sphere);
    for (const double reach : {0.05, 0.3, 0.8, 1.5})
        for (const Vec3& place : {Vec3(0, 0, 1), Vec3(0.6, -0.48, 0.64), Vec3(-0.9, 0.1, 0.3)}) {
            const auto patch = patch_around(place, reach, sphere, fine, kSpacing);
            ASSERT_TRUE(patch.has_value()) << reach;
            EXPECT_EQ(patch->euler, 0);
            for (std::size_t t = 0; t < sphere.triangles.size(); ++t) {
                const auto& [i, j, k] = sphere.triangles[t];
                const double d2 =
                    squared_distance(place, sphere.points[i], sphere.points[j], sphere.points[k]);
                EXPECT_TRUE(patch->gone[t] || d2 > reach * reach);
            }
            const TriangleMesh result = patched(sphere, *patch);
            expect_sound(result, 1, 2);
            EXPECT_GT(enclosed_volume(result), volume);  // the finer sphere is the larger
            EXPECT_LT(enclosed_volume(result), enclosed_volume(fine));
        }
}

TEST(Patch, BringsAWholeComponentWhereAllOfItGoes) {
    const TriangleMesh ball = support::icosphere(1), fine = support::icosphere(3);
    const auto patch = patch_around({0, 0, 0}, 2.0, ball, fine, 0.2);
    ASSERT_TRUE(patch.has_value());
    EXPECT_EQ(std::count(patch->gone.begin(), patch->gone.end(), 0), 0);
    expect_sound(patched(ball, *patch), 1, 2);
    EXPECT_EQ(patch->triangles.size(), fine.triangles.size());
}

TEST(Patch, IsNoneWhereTheOtherMeshIsElsewhere) {
    const TriangleMesh sphere = support::icosphere(2);
    EXPECT_FALSE(patch_around({0, 0, 1}, 0.3, sphere, support::icosphere(4, {9, 0, 0}), 0.1));
    EXPECT_FALSE(patch_around({0, 0, 5}, 0.3, sphere, support::icosphere(4), 0.1));
}

/// Two balls, and a bar between them where `joined`.
TriangleMesh two_balls(bool joined) {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -24; x <= 24; ++x)
        for (int y = -12; y <= 12; ++y)
            for (int z = -12; z <= 12; ++z) {
                const Vec3 p(x, y, z);
                double d =
                    std::min((p - Vec3(11.6, 0.1, 0.3)).norm(), (p + Vec3(11.3, 0.2, 0.1)).norm()) - 9.2;
                if (joined) d = std::min(d, std::max(std::hypot(y - 0.1, z + 0.2) - 1.4, std::abs(x) - 11.0));
                if (std::abs(d) < 3.0)
                    values.setValue({x, y, z}, static_cast<float>(d));
                else if (d < 0.0)
                    values.setValueOff({x, y, z}, -3.0f);
            }
    return volume_to_mesh(LevelSet(grid));
}

TEST(Patch, BringsTheOtherMeshsTopology) {
    const TriangleMesh apart = two_balls(false), joined = two_balls(true);
    ASSERT_EQ(mesh_topology(apart).components, 2u);
    ASSERT_EQ(mesh_topology(joined).components, 1u);
    const auto join = patch_around({0, 0, 0}, 5.0, apart, joined, 1.0);
    ASSERT_TRUE(join.has_value());
    EXPECT_EQ(join->euler, -2);
    expect_sound(patched(apart, *join), 1, 2);
    const auto part = patch_around({0, 0, 0}, 5.0, joined, apart, 1.0);
    ASSERT_TRUE(part.has_value());
    EXPECT_EQ(part->euler, 2);
    expect_sound(patched(joined, *part), 2, 4);
}

}  // namespace
}  // namespace isotrack
