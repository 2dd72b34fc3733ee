#include "surface/grid_part.h"

#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <limits>
#include <vector>

namespace isotrack {
namespace {

/// With tiles inside and out, and leaves on both sides of nodes with negative coordinates.
openvdb::FloatGrid::Ptr ball() {
    return openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(50.0f, openvdb::Vec3f(3.0f, -2.0f, 1.0f),
                                                                    1.0f);
}

TEST(GridPart, HasWhatTheGridHasAround) {
    const openvdb::FloatGrid::Ptr grid = ball();
    const std::vector<Vec3> places = {Vec3(53.2, -2.1, 0.6), Vec3(-31.5, -37.5, 1.0)};
    const Vec3 reach(9.0, 6.5, 12.0);
    const openvdb::FloatGrid::Ptr part = part_around(*grid, places, reach);
    ASSERT_TRUE(part);
    EXPECT_EQ(part->transform(), grid->transform());
    EXPECT_EQ(part->getGridClass(), grid->getGridClass());
    EXPECT_GT(part->tree().leafCount(), 0u);
    EXPECT_LE(part->tree().leafCount(), grid->tree().leafCount() / 4);
    int inside_tiles = 0;
    for (const Vec3& place : places) {
        const Vec3 low = (place - reach).array().ceil(), high = (place + reach).array().floor();
        const openvdb::CoordBBox box(openvdb::Coord(low.x(), low.y(), low.z()),
                                     openvdb::Coord(high.x(), high.y(), high.z()));
        for (auto node = box.begin(); node; ++node) {
            ASSERT_EQ(part->tree().getValue(*node), grid->tree().getValue(*node)) << *node;
            ASSERT_EQ(part->tree().isValueOn(*node), grid->tree().isValueOn(*node)) << *node;
            inside_tiles += !grid->tree().probeConstLeaf(*node) && grid->tree().getValue(*node) < 0.0f;
        }
    }
    EXPECT_GT(inside_tiles, 0);
}

TEST(GridPart, HasTilesOfAnyValue) {
    const openvdb::FloatGrid::Ptr grid = ball();
    const openvdb::Coord low(80, 0, 0), far(96, 0, 0);
    grid->tree().addTile(1, low, 7.0f, true);
    grid->tree().addTile(1, far, 8.0f, false);
    const openvdb::FloatGrid::Ptr part = part_around(*grid, {Vec3(84.0, 4.0, 4.0)}, Vec3::Constant(14.0));
    ASSERT_TRUE(part);
    for (auto node = openvdb::CoordBBox({70, -10, -10}, {98, 18, 18}).begin(); node; ++node) {
        ASSERT_EQ(part->tree().getValue(*node), grid->tree().getValue(*node)) << *node;
        ASSERT_EQ(part->tree().isValueOn(*node), grid->tree().isValueOn(*node)) << *node;
    }
}

TEST(GridPart, IsNoneOfALargePart) {
    const openvdb::FloatGrid::Ptr grid = ball();
    for (const double reach : {1e4, 1e8, 1e12, 1e300, std::numeric_limits<double>::infinity()})
        EXPECT_FALSE(part_around(*grid, {Vec3::Zero()}, Vec3::Constant(reach))) << reach;
    EXPECT_FALSE(part_around(*grid, {Vec3(53.0, -2.0, 1.0)}, Vec3::Constant(50.0)));
    std::vector<Vec3> all_over;
    for (auto node = grid->cbeginValueOn(); node; ++node) {
        const openvdb::Coord at = node.getCoord();
        all_over.emplace_back(at.x(), at.y(), at.z());
    }
    EXPECT_FALSE(part_around(*grid, all_over, Vec3::Ones()));
    EXPECT_FALSE(part_around(*openvdb::FloatGrid::create(3.0f), {Vec3::Zero()}, Vec3::Ones()));
}

TEST(GridPart, IsEmptyAwayFromTheGridAndWithoutPlaces) {
    const openvdb::FloatGrid::Ptr grid = ball();
    for (const std::vector<Vec3>& places :
         {std::vector<Vec3>(), {Vec3(500.0, 0.0, 0.0)}, {Vec3(0.0, -1e11, 0.0)}}) {
        const openvdb::FloatGrid::Ptr part = part_around(*grid, places, Vec3::Constant(5.0));
        ASSERT_TRUE(part);
        EXPECT_TRUE(part->tree().empty());
    }
}

}  // namespace
}  // namespace isotrack
