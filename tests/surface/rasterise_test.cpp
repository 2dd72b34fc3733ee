#include "isotrack/surface/rasterise.h"

#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <limits>

#include "isotrack/error.h"
#include "isotrack/surface/shapes.h"
#include "support/voxel_topology.h"

namespace isotrack {
namespace {

TEST(Rasterise, GivesTheGridThatOpenVdbMakesOfASphere) {
    constexpr double kVoxel = 0.02;
    const auto grid = rasterise(*shapes::sphere({0.1, -0.2, 0.3}, 0.5, kVoxel), kVoxel);
    const auto expected = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(
        0.5f, openvdb::Vec3f(0.1f, -0.2f, 0.3f), kVoxel, 3.0f);
    EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
    EXPECT_NEAR(static_cast<double>(grid->activeVoxelCount()),
                static_cast<double>(expected->activeVoxelCount()), 100.0);
    auto access = expected->getConstAccessor();
    openvdb::CoordBBox box = expected->evalActiveVoxelBoundingBox();
    box.expand(20);
    auto ours = grid->getConstAccessor();
    for (auto ijk = box.begin(); ijk; ++ijk)
        ASSERT_NEAR(ours.getValue(*ijk), access.getValue(*ijk), 1e-6) << *ijk;
}

TEST(Rasterise, FillsTheInsideOfABodyOfManyBlocks) {
    constexpr double kVoxel = 0.002;
    const auto surface =
        shapes::sphere({0.013, 0.4, -0.7}, 1.1, kVoxel);  // 550 voxels: deeper than a node of 128
    const auto grid = rasterise(*surface, kVoxel);
    const auto probe = surface->probe();
    auto access = grid->getConstAccessor();
    for (int x = -700; x <= 700; x += 37)
        for (int y = -500; y <= 900; y += 41)
            for (int z = -1000; z <= 300; z += 43) {
                const double value = probe->value(kVoxel * Vec3(x, y, z));
                const double expected = std::max(-3.0 * kVoxel, std::min(3.0 * kVoxel, value));
                ASSERT_NEAR(access.getValue({x, y, z}), expected, 1e-6) << x << ' ' << y << ' ' << z;
            }
}

TEST(Rasterise, KeepsVoidsOpen) {
    const auto grid = rasterise(*shapes::shell({0, 0, 0}, 0.5, 0.1, 0.02), 0.02);
    const auto components = testing::voxel_components(*grid);
    EXPECT_EQ(components.inside, 1u);
    EXPECT_EQ(components.outside, 2u);
}

TEST(Rasterise, GivesNoVoxelsWithoutASurface) {
    const auto grid = rasterise(*shapes::from_function([](const Vec3&) { return 1.0; }, Box(), 0.1), 0.1);
    EXPECT_EQ(grid->activeVoxelCount(), 0u);
    EXPECT_GT(grid->background(), 0.0f);
}

TEST(Rasterise, RefusesAVoxelThatIsNoLength) {
    const auto surface = shapes::sphere({0, 0, 0}, 0.5, 0.1);
    EXPECT_THROW(rasterise(*surface, 0.0), OptionError);
    EXPECT_THROW(rasterise(*surface, -0.1), OptionError);
    EXPECT_THROW(rasterise(*surface, std::numeric_limits<double>::quiet_NaN()), OptionError);
    EXPECT_THROW(rasterise(*surface, std::numeric_limits<double>::infinity()), OptionError);
}

}  // namespace
}  // namespace isotrack
