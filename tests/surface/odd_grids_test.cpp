// Grids as odd writers leave them: dense blocks, tiles, values that are not finite, unknown classes, none at
// all.
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "isotrack/error.h"
#include "isotrack/surface/level_set.h"
#include "support/dense_block.h"
#include "support/sphere_grid.h"
#include "support/unit_sphere.h"

namespace isotrack {
namespace {

using support::dense_block;
using support::expect_unit_sphere;
using support::near_sphere;
using support::sphere_grid;
using support::uniform;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

TEST(OddGrid, ReadsADenseBlockWithFarValues) {
    const Vec3 centre(0.8, 0.8, 0.8);
    const auto grid = dense_block(32, 0.05, [&](const Vec3& p) {
        const double d = (p - centre).norm() - 0.5;
        return d > 0.15 ? 10000.0 : d;
    });
    const LevelSet level_set(grid);
    EXPECT_EQ(level_set.value_scale(), 1.0);
    EXPECT_EQ(level_set.border_crossings(), 0u);
    const auto probe = level_set.probe();
    for (const Vec3& direction : near_sphere(500, 0.0)) {
        EXPECT_NEAR(probe->value(centre + 0.53 * direction), 0.03, 0.004);
        EXPECT_GT(probe->normal(centre + 0.5 * direction).dot(direction), 0.99);
    }
    EXPECT_LT(probe->value(centre), 0.0);
    EXPECT_GT(probe->value({0.02, 0.02, 0.02}), 0.0);
    EXPECT_GT(probe->value({-1, 0.8, 0.8}), 0.0);  // beyond the block, where the background was 0
    for (const auto& c : level_set.crossings()) EXPECT_NEAR((c.point - centre).norm(), 0.5, 0.003);
}

TEST(OddGrid, CapsWhatRunsIntoTheBorderOfItsBlockOneVoxelBeyond) {
    // A pool: water below z = 0.33, and to all sides as far as the block goes.
    const int n = 20;
    const double voxel = 0.05, surface = 0.33;
    const auto grid =
        dense_block(n, voxel, [&](const Vec3& p) { return p.z() > 0.5 ? 10000.0 : p.z() - surface; });
    const LevelSet level_set(grid);
    EXPECT_GT(level_set.border_crossings(), 0u);
    const auto probe = level_set.probe();
    const double low = -voxel, high = n * voxel;  // the cap: one voxel beyond the first and the last
    // The solid is the box between the caps and the water's surface.
    std::mt19937 random(5);
    std::uniform_real_distribution<double> coordinate(-0.4, 1.4);
    int inside = 0;
    for (int i = 0; i < 20000; ++i) {
        const Vec3 p(coordinate(random), coordinate(random), coordinate(random));
        const double d =
            std::max({low - p.x(), p.x() - high, low - p.y(), p.y() - high, low - p.z(), p.z() - surface});
        if (std::abs(d) < 0.02) continue;
        ASSERT_EQ(probe->value(p) < 0.0, d < 0.0) << p.transpose();
        inside += d < 0.0;
    }
    EXPECT_GT(inside, 1000);
    EXPECT_NEAR(probe->value({0.5, 0.5, surface}), 0.0, 1e-6);
    EXPECT_NEAR(probe->value({0.5, high, 0.1}), 0.0, 1e-6);
    EXPECT_NEAR(probe->value({low, 0.5, 0.1}), 0.0, 1e-6);
    EXPECT_NEAR(probe->value({0.5, 0.5, low}), 0.0, 1e-6);
    // Crossings lie on the five flat sides and the surface, all six of them found.
    int found[6] = {};
    for (const auto& c : level_set.crossings()) {
        const double gap[6] = {c.point.x() - low,  c.point.x() - high, c.point.y() - low,
                               c.point.y() - high, c.point.z() - low,  c.point.z() - surface};
        const auto nearest =
            std::min_element(gap, gap + 6, [](double a, double b) { return std::abs(a) < std::abs(b); });
        ASSERT_NEAR(*nearest, 0.0, 1e-5);
        ++found[nearest - gap];
    }
    for (const int count : found) EXPECT_GT(count, 100);
    const Box box = level_set.bounds();
    EXPECT_LT((box.min() - Vec3::Constant(low)).norm(), 1e-5);
    EXPECT_LT((box.max() - Vec3(high, high, surface)).norm(), 1e-5);
}

TEST(OddGrid, MeetsTheBorderWhereVolumeToMeshPutsIt) {
    const auto grid = dense_block(16, 0.1, [](const Vec3& p) { return p.z() - 0.72; });
    const LevelSet level_set(grid);
    // What volumeToMesh makes of the grid that is sampled, and the surface we say it is, are the same.
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*level_set.grid(), points, quads);
    ASSERT_GT(points.size(), 100u);
    const auto probe = level_set.probe();
    // Its vertices round off the edges of the box by less than half a voxel.
    for (const auto& p : points) EXPECT_LT(std::abs(probe->value({p.x(), p.y(), p.z()})), 0.5 * 0.1);
}

TEST(OddGrid, CountsValuesThatAreNotFiniteAsOutside) {
    const Vec3 centre(0.8, 0.8, 0.8);
    for (const double far : {kInf, kNaN}) {
        const auto grid = dense_block(32, 0.05, [&](const Vec3& p) {
            const double d = (p - centre).norm() - 0.5;
            return d > 0.2 ? far : d;
        });
        const LevelSet level_set(grid);
        const auto probe = level_set.probe();
        EXPECT_GT(probe->value({0.05, 0.05, 0.05}), 0.0) << far;
        EXPECT_TRUE(std::isfinite(probe->value({0.05, 0.05, 0.05}))) << far;
        EXPECT_LT(probe->value(centre), 0.0) << far;
        for (const Vec3& direction : near_sphere(200, 0.0))
            EXPECT_NEAR(probe->value(centre + 0.5 * direction), 0.0, 0.004) << far;
        for (auto value = level_set.grid()->cbeginValueAll(); value; ++value)
            ASSERT_TRUE(std::isfinite(*value)) << far;
    }
}

TEST(OddGrid, HasNoValuesThatAreNotFiniteWhereTheBackgroundIsRight) {
    // Far outside and far inside, active and not; there are more leaves than one thread takes.
    for (const bool active : {true, false})
        for (const double far : {kInf, -kInf, kNaN}) {
            const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.02), 0.12);
            ASSERT_GT(grid->tree().leafCount(), 1000u);
            auto accessor = grid->getAccessor();
            for (const int x : {46, -55}) {  // 0.08 inside, 0.1 outside
                const openvdb::Coord c(x, 0, 0);
                accessor.setValue(c, static_cast<float>(far));
                if (!active) accessor.setActiveState(c, false);
            }
            const LevelSet level_set(grid);
            for (auto value = level_set.grid()->cbeginValueAll(); value; ++value)
                ASSERT_TRUE(std::isfinite(*value)) << active << " " << far;
            const auto probe = level_set.probe();
            for (const Vec3& p : near_sphere(500, 0.0)) {
                if (std::abs(p.x()) > 0.9) continue;
                EXPECT_NEAR(probe->value(p), 0.0, 2e-4) << active << " " << far;
            }
        }
}

TEST(OddGrid, CountsTilesThatAreNotFiniteAsFar) {
    for (const double far : {kInf, kNaN}) {
        const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.04), 0.12);
        grid->tree().addTile(1, openvdb::Coord(0), static_cast<float>(-far), false);
        grid->tree().addTile(1, openvdb::Coord(32, 0, 0), static_cast<float>(far), false);
        const LevelSet level_set(grid);
        for (const Surface::Crossing& c : level_set.crossings()) ASSERT_TRUE(c.point.allFinite()) << far;
        EXPECT_TRUE(std::isfinite(level_set.probe()->value({0.1, 0.1, 0.1}))) << far;
        EXPECT_GT(level_set.probe()->value({1.4, 0.1, 0.1}), 0.0) << far;
    }
}

TEST(OddGrid, RefusesValuesThatCannotBeMadeDistances) {
    const auto grid = dense_block(16, 0.1, [](const Vec3& p) { return p.z() > 0.75 ? 1e-41 : -1e-41; });
    try {
        LevelSet{grid};
        FAIL();
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("hardly differ"), std::string::npos) << error.what();
    }
}

TEST(OddGrid, CountsMinusInfinityAsInside) {
    const Vec3 centre(0.8, 0.8, 0.8);
    const auto grid = dense_block(32, 0.05, [&](const Vec3& p) {
        const double d = (p - centre).norm() - 0.5;
        return d < -0.2 ? -kInf : d > 0.2 ? kInf : d;
    });
    const LevelSet level_set(grid);
    const auto probe = level_set.probe();
    EXPECT_GT(probe->value({0.05, 0.05, 0.05}), 0.0);
    EXPECT_LT(probe->value(centre), 0.0);
    EXPECT_TRUE(std::isfinite(probe->value(centre)));
    for (const auto& c : level_set.crossings()) EXPECT_NEAR((c.point - centre).norm(), 0.5, 0.003);
}

TEST(OddGrid, CountsActiveTiles) {
    // The inside of the sphere as active tiles of a constant value, as some writers leave it.
    const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.04), 0.12);
    grid->tree().prune();
    const openvdb::CoordBBox middle(openvdb::Coord(-8), openvdb::Coord(7));
    grid->fill(middle, -0.12f, true);
    ASSERT_GT(grid->tree().activeTileCount(), 0u);
    const LevelSet level_set(grid);
    expect_unit_sphere(level_set, 0.04);
}

TEST(OddGrid, KnowsInsideTiles) {
    // A large sphere, so that there are inactive tiles inside; one of them with all the children pruned away.
    const auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(1.0f, openvdb::Vec3f(0.0f), 0.02f, 3.0f);
    ASSERT_LT(grid->tree().getValue(openvdb::Coord(0)), 0.0f);
    expect_unit_sphere(LevelSet(grid), 0.02);
    // And through the copying path.
    const auto scaled = grid->deepCopy();
    scaled->setTransform(uniform(0.2));
    const LevelSet level_set(scaled);
    EXPECT_NEAR(level_set.value_scale(), 10.0, 0.1);
    EXPECT_LT(level_set.probe()->value(Vec3::Zero()), 0.0);
    EXPECT_NEAR(level_set.probe()->value({10.1, 0, 0}), 0.1, 0.02);
}

TEST(OddGrid, RefusesAnUnknownClassWithoutSignChange) {
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(10)), 1.0f, true);
    EXPECT_THROW(LevelSet{grid}, InputError);
    LevelSetOptions options;
    options.iso = 2.0;
    EXPECT_THROW(LevelSet(grid, options), InputError);
    const auto nothing = openvdb::FloatGrid::create(1.0f);
    EXPECT_THROW(LevelSet{nothing}, InputError);
}

TEST(OddGrid, AcceptsAnUnknownClassThatChangesSign) {
    const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.08), 0.24);
    grid->setGridClass(openvdb::GRID_UNKNOWN);
    expect_unit_sphere(LevelSet(grid), 0.08);
}

TEST(OddGrid, MayBeEmpty) {
    auto none = openvdb::FloatGrid::create(0.3f);
    none->setGridClass(openvdb::GRID_LEVEL_SET);
    auto outside = none->deepCopy();
    outside->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(10)), 0.2f, true);
    for (const auto& grid : {none, outside}) {
        const LevelSet level_set(grid);
        EXPECT_TRUE(level_set.empty());
        EXPECT_TRUE(level_set.bounds().isEmpty());
        EXPECT_EQ(level_set.crossing_count(), 0u);
        EXPECT_TRUE(level_set.crossings().empty());
        EXPECT_GT(level_set.probe()->value(Vec3::Zero()), 0.0);
        EXPECT_FALSE(level_set.probe()->project(Vec3::Zero()));
    }
}

TEST(OddGrid, RefusesWhatItCannotSample) {
    EXPECT_THROW(LevelSet{nullptr}, InputError);
    const auto ints = openvdb::Int32Grid::create(1);
    ints->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(10)), -1, true);
    ints->setGridClass(openvdb::GRID_LEVEL_SET);
    EXPECT_THROW(LevelSet{ints}, InputError);

    const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.08), 0.24);
    grid->setTransform(openvdb::math::Transform::createFrustumTransform(
        openvdb::BBoxd(openvdb::Vec3d(0.0), openvdb::Vec3d(100.0)), 0.5, 10.0));
    EXPECT_THROW(LevelSet{grid}, InputError);
    try {
        grid->setName("drops");
        const LevelSet level_set(grid);
        FAIL();
    } catch (const InputError& error) {
        const std::string what = error.what();
        EXPECT_NE(what.find("drops"), std::string::npos) << what;
        EXPECT_EQ(what.find('\n'), std::string::npos);
    }
}

}  // namespace
}  // namespace isotrack
