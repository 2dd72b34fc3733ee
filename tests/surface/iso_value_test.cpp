// A surface where the values are something else than zero.
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/LevelSetUtil.h>

#include <algorithm>
#include <string>

#include "isotrack/error.h"
#include "isotrack/surface/level_set.h"
#include "support/dense_block.h"
#include "support/unit_sphere.h"

namespace isotrack {
namespace {

using support::near_sphere;
constexpr double kVoxel = 0.05;
constexpr double kBound = 0.5 * kVoxel * kVoxel;  // trilinear interpolation is off by less

openvdb::FloatGrid::Ptr unit_sphere(float half_width) {
    return openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(1.0f, openvdb::Vec3f(0.0f), kVoxel,
                                                                    half_width);
}

TEST(IsoValue, PutsTheSurfaceAtTheIsoValue) {
    const auto grid = unit_sphere(8.0f);
    for (const double iso : {-0.15, 0.1, 0.2}) {
        const LevelSet level_set(grid, {iso});
        const auto probe = level_set.probe();
        for (const Vec3& direction : near_sphere(300, 0.0)) {
            const Vec3 p = (1.0 + iso) * direction;
            EXPECT_NEAR(probe->value(p), 0.0, kBound);
            EXPECT_NEAR(probe->value(p + 0.03 * direction), 0.03, kBound);
        }
        EXPECT_LT(probe->value(Vec3::Zero()), 0.0);
        EXPECT_GT(probe->value({5, 0, 0}), 0.0);
    }
}

TEST(IsoValue, TakesAFogVolumeWithAnIsoValueOnly) {
    // Density falls from 1 inside to 0 within three voxels.
    const auto grid = unit_sphere(3.0f);
    openvdb::tools::sdfToFogVolume(*grid);
    ASSERT_EQ(grid->getGridClass(), openvdb::GRID_FOG_VOLUME);
    EXPECT_THROW(LevelSet{grid}, InputError);
    const LevelSet level_set(grid, {0.5});
    const auto probe = level_set.probe();
    for (const Vec3& direction : near_sphere(300, 0.0)) {
        EXPECT_NEAR(probe->value(0.925 * direction), 0.0, 0.004);  // half way through the three voxels
        EXPECT_GT(probe->normal(0.925 * direction).dot(direction), 0.99);
        // The slope is measured, so distances near the surface are of the world.
        EXPECT_NEAR(probe->value(0.955 * direction), 0.03, 0.006);
    }
    EXPECT_LT(probe->value(Vec3::Zero()), 0.0);
    EXPECT_GT(probe->value({3, 0, 0}), 0.0);
    EXPECT_EQ(level_set.border_crossings(), 0u);

    EXPECT_THROW(LevelSet(grid, {2.0}), InputError);  // above every density
}

TEST(IsoValue, IsRefusedWhereTheBandEnds) {
    for (const double unit : {1.0, 1.0 / kVoxel}) {
        const auto grid = unit_sphere(3.0f);
        if (unit != 1.0) {
            for (auto value = grid->beginValueAll(); value; ++value)
                value.setValue(static_cast<float>(unit * *value));
            openvdb::tools::changeBackground(grid->tree(), static_cast<float>(3.0 * kVoxel * unit));
        }
        EXPECT_FALSE(LevelSet(grid, {2.5 * kVoxel * unit}).empty());
        for (const double voxels : {2.9, 3.0, 3.1, 40.0})
            for (const double side : {-1.0, 1.0}) {
                const double iso = side * voxels * kVoxel * unit;
                try {
                    const LevelSet level_set(grid, {iso});
                    ADD_FAILURE() << iso << " of a band of " << grid->background();
                } catch (const InputError& error) {
                    EXPECT_NE(std::string(error.what()).find("band"), std::string::npos) << error.what();
                }
            }
        for (const double voxels : {-1.25, 1.25}) {  // whole cells are in the band
            const LevelSet level_set(grid, {voxels * kVoxel * unit});
            const auto probe = level_set.probe();
            for (const Vec3& direction : near_sphere(300, 0.0))
                EXPECT_NEAR(probe->value((1.0 + voxels * kVoxel) * direction), 0.0, kBound);
        }
    }
}

TEST(IsoValue, IsTakenWhereTheInsideIsKnownFarther) {
    // Three voxels outside, ten inside.
    const auto grid = openvdb::FloatGrid::create(3.0f * kVoxel);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(kVoxel));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto accessor = grid->getAccessor();
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-24), openvdb::Coord(24)).begin(); c; ++c) {
        const double d = kVoxel * (*c).asVec3d().length() - 1.0;
        if (d > 3.0 * kVoxel) continue;
        if (d > -10.0 * kVoxel)
            accessor.setValue(*c, static_cast<float>(d));
        else
            accessor.setValueOff(*c, static_cast<float>(-10.0 * kVoxel));
    }
    const LevelSet level_set(grid, {-5.0 * kVoxel});
    const auto probe = level_set.probe();
    for (const Vec3& direction : near_sphere(300, 0.0))
        EXPECT_NEAR(probe->value(0.75 * direction), 0.0, kBound);
    EXPECT_THROW(LevelSet(grid, {-9.9 * kVoxel}), InputError);
    EXPECT_THROW(LevelSet(grid, {2.9 * kVoxel}), InputError);
}

TEST(IsoValue, IsTakenInBlocksThatSayNothingOfTheOutside) {
    const Vec3 centre(0.8, 0.8, 0.8);
    const auto block =
        support::dense_block(32, kVoxel, [&](const Vec3& p) { return (p - centre).norm() - 0.5; });
    const LevelSet ball(block, {0.1});
    const auto of_ball = ball.probe();
    for (const Vec3& direction : near_sphere(300, 0.0))
        EXPECT_NEAR(of_ball->value(centre + 0.6 * direction), 0.0, 2.0 * kBound);
    // A shallow pool, to all sides as far as the block goes: most of its surface is the border.
    const auto pool = support::dense_block(20, kVoxel, [](const Vec3& p) { return p.z() - 0.12; });
    openvdb::tools::changeBackground(pool->tree(), 3.0f * static_cast<float>(kVoxel));
    for (const double iso : {-0.01, 0.01}) {
        const LevelSet water(pool, {iso});
        EXPECT_NEAR(water.probe()->value({0.5, 0.5, 0.12 + iso}), 0.0, 1e-6);
        EXPECT_GT(water.border_crossings(), 0u);
    }
}

TEST(IsoValue, LeavesLessOfTheBandOnOneSide) {
    // A tolerance must not be larger than what is known on either.
    for (const double voxels : {-2.25, -1.25, 1.25, 2.25}) {
        const LevelSet level_set(unit_sphere(3.0f), {voxels * kVoxel});
        EXPECT_GT(level_set.reach(), kVoxel);
        const auto probe = level_set.probe();
        for (const Vec3& direction : near_sphere(100, 0.0))
            for (const double r : {0.1, 0.5, 1.5, 1.9})
                EXPECT_GE(std::abs(probe->farther_value(r * direction)),
                          std::min(level_set.reach(), std::abs(r - 1.0 - voxels * kVoxel)) - 0.15 * kVoxel);
    }
}

TEST(IsoValue, OfAFogVolumeIsNearerToOneOfItsEnds) {
    // Three voxels of slope, of which 0.3 are inside.
    const auto grid = unit_sphere(3.0f);
    openvdb::tools::sdfToFogVolume(*grid);
    const LevelSet level_set(grid, {0.9});
    EXPECT_LT(level_set.reach(), 0.7 * kVoxel);
    EXPECT_GE(std::abs(level_set.probe()->farther_value(Vec3::Zero())), level_set.reach() - 1e-6);
}

TEST(IsoValue, MayHaveNoSurfaceInTheBand) {
    // Blown up or shrunk by less than the band is wide, a frame may be empty.
    const auto drop =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(0.09f, openvdb::Vec3f(0.0f), kVoxel, 3.0f);
    EXPECT_TRUE(LevelSet(drop, {-2.2 * kVoxel}).empty());
    auto none = openvdb::FloatGrid::create(0.15f);
    none->setGridClass(openvdb::GRID_LEVEL_SET);
    EXPECT_TRUE(LevelSet(none, {0.1}).empty());
    EXPECT_TRUE(LevelSet(none, {40.0}).empty());
}

}  // namespace
}  // namespace isotrack
