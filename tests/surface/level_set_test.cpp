// Grids as they really come, held against the sphere (or plane, or box) they were made from.
#include "isotrack/surface/level_set.h"

#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>
#include <set>
#include <sstream>
#include <thread>
#include <utility>

#include "isotrack/error.h"
#include "isotrack/io/vdb_file.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/dense_block.h"
#include "support/unit_sphere.h"

namespace isotrack {
namespace {

using support::dense_block;
using support::near_sphere;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

/// Calls set(coord, signed distance in world units) for the voxels of a box around the unit sphere under
/// `transform`.
template <typename GridType>
typename GridType::Ptr sphere_grid(const openvdb::math::Transform::Ptr& transform, double band,
                                   double unit = 1.0) {
    using Value = typename GridType::ValueType;
    auto grid = GridType::create(static_cast<Value>(band * unit));
    grid->setTransform(transform);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    openvdb::CoordBBox box;
    for (int i = 0; i < 8; ++i) {
        const openvdb::Vec3d corner(i & 1 ? 1.5 : -1.5, i & 2 ? 1.5 : -1.5, i & 4 ? 1.5 : -1.5);
        box.expand(openvdb::Coord::round(transform->worldToIndex(corner)));
    }
    auto accessor = grid->getAccessor();
    for (auto c = box.begin(); c; ++c) {
        const double d = transform->indexToWorld(*c).length() - 1.0;
        if (std::abs(d) < band)
            accessor.setValue(*c, static_cast<Value>(d * unit));
        else if (d < 0.0)
            accessor.setValueOff(*c, static_cast<Value>(-band * unit));
    }
    return grid;
}

openvdb::math::Transform::Ptr uniform(double voxel) {
    return openvdb::math::Transform::createLinearTransform(voxel);
}

/// Holds a level set against the unit sphere. `h`: the longest voxel edge. A trilinear interpolant of a
/// distance whose curvature is at most 1 / 0.8 is off by at most 3 / 8 h^2 / 0.8 (one h^2 / 8 per axis).
void expect_unit_sphere(const LevelSet& level_set, double h) {
    ASSERT_FALSE(level_set.empty());
    const double bound = 0.5 * h * h + 1e-4 * h;
    const auto probe = level_set.probe();
    for (const Vec3& p : near_sphere(2000, 0.8 * h)) {
        const auto s = probe->sample(p);
        ASSERT_NEAR(s.value, p.norm() - 1.0, bound);
        ASSERT_NEAR(probe->value(p), s.value, 1e-6);
        ASSERT_LT((s.gradient - p.normalized()).norm(), 2.0 * h * h + 1e-3) << s.gradient.transpose();
        const auto q = probe->project(p);
        ASSERT_TRUE(q);
        ASSERT_NEAR(q->norm(), 1.0, bound);
        ASSERT_LT((probe->normal(*q) - q->normalized()).norm(), 2.0 * h * h + 1e-3);
        ASSERT_LT((*q - p.normalized()).norm(), 0.1 * h);
    }
    // Signs, near and far.
    std::mt19937 random(3);
    std::uniform_real_distribution<double> coordinate(-3.0, 3.0);
    for (int i = 0; i < 2000; ++i) {
        const Vec3 p(coordinate(random), coordinate(random), coordinate(random));
        if (std::abs(p.norm() - 1.0) < h) continue;
        ASSERT_EQ(probe->value(p) < 0.0, p.norm() < 1.0) << p.transpose();
    }
    EXPECT_LT(probe->value(Vec3::Zero()), 0.0);
    for (const Vec3& far :
         {Vec3(1e6, 0, 0), Vec3(-1e30, 2, 3), Vec3(0, 1e300, 0), Vec3(kNaN, 0, 0), Vec3(kInf, 0, -kInf)})
        EXPECT_GT(probe->value(far), 0.0);
    EXPECT_FALSE(probe->project({kNaN, 0, 0}));
    EXPECT_FALSE(probe->project({100, 0, 0}));
    EXPECT_TRUE(probe->normal({100, 0, 0}).isZero());

    const auto crossings = level_set.crossings();
    EXPECT_EQ(crossings.size(), level_set.crossing_count());
    for (const auto& c : crossings) {
        ASSERT_NEAR(c.point.norm(), 1.0, h * h);
        ASSERT_NEAR(c.outward.norm(), 1.0f, 1e-5f);
        ASSERT_GT(c.outward.cast<double>().dot(c.point.normalized()), -1.5 * h);
    }
    const Box box = level_set.bounds();
    EXPECT_LT((box.min() + Vec3::Ones()).norm(), 2.0 * h);
    EXPECT_LT((box.max() - Vec3::Ones()).norm(), 2.0 * h);
}

/// Edges of the lattice between values of different sign, counted one by one.
std::size_t brute_force_crossings(const openvdb::FloatGrid& grid, openvdb::CoordBBox box) {
    box.expand(2);
    const auto accessor = grid.getConstAccessor();
    std::size_t count = 0;
    for (auto c = box.begin(); c; ++c)
        for (int axis = 0; axis < 3; ++axis)
            count += (accessor.getValue(*c) < 0.0f) !=
                     (accessor.getValue((*c).offsetBy(axis == 0, axis == 1, axis == 2)) < 0.0f);
    return count;
}

TEST(LevelSet, FindsTheCrossedEdgesOfARandomGrid) {
    // Scattered leaves with random values, active or not, beside tiles of either sign.
    std::mt19937 random(5);
    for (int trial = 0; trial < 20; ++trial) {
        const auto grid = openvdb::FloatGrid::create(3.0f);
        grid->setGridClass(openvdb::GRID_LEVEL_SET);
        for (int leaf = 0; leaf < 27; ++leaf) {
            const openvdb::Coord origin(8 * (leaf / 9 - 1), 8 * (leaf / 3 % 3 - 1), 8 * (leaf % 3 - 1));
            if (random() % 3 == 0) {
                grid->tree().addTile(1, origin, random() % 2 == 0 ? 3.0f : -3.0f, false);
                continue;
            }
            for (int i = 0; i < 512; ++i) {
                const openvdb::Coord c = origin.offsetBy(i / 64, i / 8 % 8, i % 8);
                const float value = 0.01f * (static_cast<float>(random() % 400) - 199.5f);
                random() % 4 == 0 ? grid->tree().setValueOff(c, value) : grid->tree().setValueOn(c, value);
            }
        }
        using Edge = std::pair<openvdb::Coord, int>;
        std::set<Edge> expected, found, found_upright;
        std::size_t at_border = 0;
        const auto value = grid->getConstAccessor();
        const auto has_leaf = [&](const openvdb::Coord& c) {
            return grid->tree().probeConstLeaf(c) != nullptr;
        };
        for (auto c = openvdb::CoordBBox(openvdb::Coord(-10), openvdb::Coord(18)).begin(); c; ++c)
            for (int axis = 0; axis < 3; ++axis) {
                const openvdb::Coord next = (*c).offsetBy(axis == 0, axis == 1, axis == 2);
                if ((value.getValue(*c) < 0.0f) == (value.getValue(next) < 0.0f)) continue;
                if (!has_leaf(*c) && !has_leaf(next)) continue;
                expected.insert({*c, axis});
                at_border += !value.isValueOn(*c) || !value.isValueOn(next);
            }
        const LevelSet level_set(grid);
        ASSERT_EQ(level_set.value_scale(), 1.0);
        for (const auto& crossing : level_set.crossings()) {
            const int axis = static_cast<int>(
                std::max_element(crossing.outward.data(), crossing.outward.data() + 3,
                                 [](float a, float b) { return std::abs(a) < std::abs(b); }) -
                crossing.outward.data());
            openvdb::Coord from(0);
            for (int i = 0; i < 3; ++i) {
                const double x = crossing.point[i];
                from[i] = static_cast<int>(i == axis ? std::floor(x) : std::lround(x));
            }
            found.insert({from, axis});
        }
        for (const Eigen::Vector3i& node : level_set.upright_crossings())
            found_upright.insert({openvdb::Coord(node.x(), node.y(), node.z()), 2});
        EXPECT_EQ(found, expected);
        EXPECT_EQ(level_set.crossing_count(), expected.size());
        EXPECT_EQ(level_set.border_crossings(), at_border);
        for (auto e = expected.begin(); e != expected.end();)
            e = e->second == 2 ? std::next(e) : expected.erase(e);
        EXPECT_EQ(found_upright, expected);
    }
}

TEST(LevelSet, IsTheSphereItWasMadeFrom) {
    const double h = 0.07f;  // as the grid keeps it
    const auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(1.0f, openvdb::Vec3f(0.0f), h, 3.0f);
    const LevelSet level_set(grid);
    expect_unit_sphere(level_set, h);
    EXPECT_DOUBLE_EQ(level_set.voxel_size(), h);
    EXPECT_DOUBLE_EQ(level_set.resolution(), h);
    EXPECT_EQ(level_set.value_scale(), 1.0);
    EXPECT_EQ(level_set.active_voxels(), grid->activeVoxelCount());
    EXPECT_EQ(level_set.border_crossings(), 0u);
    EXPECT_EQ(level_set.crossing_count(), brute_force_crossings(*grid, grid->evalActiveVoxelBoundingBox()));
    EXPECT_NEAR(level_set.reach(), 4.8 * h, 1e-6);
}

TEST(LevelSet, KnowsDistancesALittleBeyondItsBand) {
    const double h = 0.02;
    // A ball with a thin plate above it, so that the nearest part of the band is not always the nearest
    // surface.
    const auto shape =
        shapes::unite({shapes::sphere({0, 0, 0}, 0.6, h), shapes::box({0, 0, 0.8}, {0.5, 0.5, 2.0 * h}, h)});
    const LevelSet level_set(rasterise(*shape, h));
    const auto probe = level_set.probe(), truth = shape->probe();
    std::mt19937 random(7);
    std::uniform_real_distribution<double> coordinate(-1.0, 1.0);
    // Beside nodes beyond the band, which say no more than its half width, interpolated values are that much
    // less.
    constexpr double kClamped = 0.15;
    std::size_t beyond = 0;
    double sum = 0.0;
    for (int i = 0; i < 200000; ++i) {
        const Vec3 p(coordinate(random), coordinate(random), coordinate(random));
        const double distance = truth->value(p), found = probe->farther_value(p);
        if (std::abs(distance) < 0.1 * h) continue;
        ASSERT_EQ(found < 0.0, distance < 0.0) << p.transpose();
        if (std::abs(distance) > level_set.reach() + 0.1 * h) {
            ASSERT_GE(std::abs(found), level_set.reach()) << p.transpose();
        } else if (std::abs(distance) > 3.0 * h && std::abs(distance) < level_set.reach()) {
            ASSERT_GE(std::abs(found), std::abs(distance) - kClamped * h) << p.transpose();
            sum += std::abs(found) - std::abs(distance);
            ++beyond;
        }
    }
    ASSERT_GT(beyond, 1000u);
    EXPECT_LT(sum / static_cast<double>(beyond), 0.1 * h);
}

TEST(LevelSet, AgreesWithOpenVdbsTrilinearSampler) {
    const auto grid = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(
        1.0f, openvdb::Vec3f(0.3f, -0.2f, 0.1f), 0.05f, 4.0f);
    const LevelSet level_set(grid);
    const auto probe = level_set.probe();
    std::mt19937 random(2);
    std::uniform_real_distribution<double> coordinate(-1.6, 1.6);
    for (int i = 0; i < 20000; ++i) {
        const Vec3 p(coordinate(random), coordinate(random), coordinate(random));
        const double expected = openvdb::tools::BoxSampler::sample(
            grid->tree(), grid->worldToIndex(openvdb::Vec3d(p.x(), p.y(), p.z())));
        ASSERT_NEAR(probe->value(p), expected, 1e-6) << p.transpose();
        ASSERT_NEAR(probe->sample(p).value, expected, 1e-6) << p.transpose();
    }
}

TEST(LevelSet, HasTheGradientOfCentralDifferencesAtNodes) {
    const auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(1.0f, openvdb::Vec3f(0.0f), 0.1f, 5.0f);
    const LevelSet level_set(grid);
    const auto probe = level_set.probe();
    const auto accessor = grid->getConstAccessor();
    for (auto voxel = grid->cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Coord c = voxel.getCoord();
        const Vec3 p = 0.1 * Vec3(c.x(), c.y(), c.z());
        const auto difference = [&](int x, int y, int z) {
            return (accessor.getValue(c.offsetBy(x, y, z)) - accessor.getValue(c.offsetBy(-x, -y, -z))) / 0.2;
        };
        const Vec3 expected(difference(1, 0, 0), difference(0, 1, 0), difference(0, 0, 1));
        ASSERT_LT((probe->sample(p).gradient - expected).norm(), 1e-5);
    }
}

TEST(LevelSet, UnderstandsTranslation) {
    auto transform = uniform(0.08);
    transform->postTranslate({0.013, -7.3, 0.04});
    expect_unit_sphere(LevelSet(sphere_grid<openvdb::FloatGrid>(transform, 0.24)), 0.08);
}

TEST(LevelSet, UnderstandsRotation) {
    auto transform = uniform(0.08);
    transform->postRotate(0.7, openvdb::math::X_AXIS);
    transform->postRotate(-0.4, openvdb::math::Z_AXIS);
    expect_unit_sphere(LevelSet(sphere_grid<openvdb::FloatGrid>(transform, 0.24)), 0.08);
}

TEST(LevelSet, UnderstandsUnevenScale) {
    auto transform = openvdb::math::Transform::createLinearTransform(1.0);
    transform->postScale({0.05, 0.1, 0.07});
    const LevelSet level_set(sphere_grid<openvdb::FloatGrid>(transform, 0.3));
    expect_unit_sphere(level_set, 0.1);
    EXPECT_NEAR(level_set.voxel_size(), std::cbrt(0.05 * 0.1 * 0.07), 1e-12);
}

TEST(LevelSet, UnderstandsMirroring) {
    auto transform = openvdb::math::Transform::createLinearTransform(1.0);
    transform->postScale({-0.08, 0.08, 0.08});
    transform->postRotate(0.3, openvdb::math::Y_AXIS);
    expect_unit_sphere(LevelSet(sphere_grid<openvdb::FloatGrid>(transform, 0.24)), 0.08);
}

TEST(LevelSet, UnderstandsShear) {
    openvdb::Mat4d matrix = openvdb::Mat4d::identity();
    matrix.setMat3(openvdb::Mat3d(0.08, 0.0, 0.0, 0.03, 0.08, 0.0, 0.0, 0.01, 0.08));
    expect_unit_sphere(LevelSet(sphere_grid<openvdb::FloatGrid>(
                           openvdb::math::Transform::createLinearTransform(matrix), 0.3)),
                       0.11);
}

TEST(LevelSet, TurnsVoxelUnitsIntoWorldUnits) {
    // A sphere of radius 20 in grid units, read with a transform that makes it a unit sphere.
    const LevelSet small(sphere_grid<openvdb::FloatGrid>(uniform(0.05), 0.15, 1.0 / 0.05));
    EXPECT_EQ(small.value_scale(), small.voxel_size());
    EXPECT_NEAR(small.value_scale(), 0.05, 1e-15);
    expect_unit_sphere(small, 0.05);
    EXPECT_NEAR(small.reach(), 0.24, 1e-6);

    const auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(20.0f, openvdb::Vec3f(0.0f), 1.0f, 3.0f);
    grid->setTransform(uniform(0.5));
    const LevelSet half(grid);
    EXPECT_EQ(half.value_scale(), 0.5);
    EXPECT_NEAR(half.probe()->value({10.25, 0, 0}), 0.25, 0.02);
    EXPECT_NEAR(half.grid()->background(), 1.5, 1e-6);
}

TEST(LevelSet, TurnsAnUnknownUnitIntoWorldUnits) {
    // Neither world nor voxels: the slope at the surface decides.
    const LevelSet level_set(sphere_grid<openvdb::FloatGrid>(uniform(0.05), 0.15, 7.0));
    EXPECT_NEAR(level_set.value_scale(), 1.0 / 7.0, 0.01 / 7.0);
    EXPECT_NEAR(level_set.probe()->value({1.04, 0, 0}), 0.04, 0.002);
}

TEST(LevelSet, KnowsTheSlopeOfItsValues) {
    // Interpolated distances of a ball of one and a half voxels are too short; by how much a sampler of
    // OpenVDB's says, along rays through its middle.
    const auto slopes_of = [](double radius, double unit) {
        const auto grid = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(
            static_cast<float>(radius), openvdb::Vec3f(0.3f, 0.1f, 0.2f), 1.0f, 3.0f);
        const openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler> sampler(*grid);
        double sum = 0.0;
        int count = 0;
        for (double z = -0.95; z < 1.0; z += 0.1)
            for (double turn = 0.05; turn < 6.28; turn += 0.1, ++count) {
                const double beside = std::sqrt(1.0 - z * z);
                const openvdb::Vec3d ray(beside * std::cos(turn), beside * std::sin(turn), z),
                    middle(0.3, 0.1, 0.2);
                sum += sampler.wsSample(middle + (radius + 0.5) * ray) -
                       sampler.wsSample(middle + (radius - 0.5) * ray);
            }
        grid->setTransform(uniform(unit));  // distances in voxels
        return std::pair(LevelSet(grid).slope(), std::min(1.0, sum / count));
    };
    for (const double unit : {1.0, 0.1}) {
        const auto [small, expected_small] = slopes_of(1.5, unit);
        const auto [large, expected_large] = slopes_of(20.0, unit);
        EXPECT_NEAR(small, expected_small, 0.05);
        EXPECT_LT(small, 0.95);
        EXPECT_NEAR(large, expected_large, 0.01);
    }
}

TEST(LevelSet, LeavesTheGridItWasGivenAlone) {
    const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.1), 0.3, 10.0);
    const auto before = grid->deepCopy();
    const LevelSet level_set(grid);
    EXPECT_EQ(grid->background(), before->background());
    EXPECT_EQ(grid->activeVoxelCount(), before->activeVoxelCount());
    for (auto voxel = before->cbeginValueOn(); voxel; ++voxel)
        ASSERT_EQ(grid->tree().getValue(voxel.getCoord()), voxel.getValue());
}

TEST(LevelSet, ReadsDoubles) {
    expect_unit_sphere(LevelSet(sphere_grid<openvdb::DoubleGrid>(uniform(0.07), 0.21)), 0.07);
}

TEST(LevelSet, ReadsHalfFloatsFromAFile) {
    const double h = 0.07;
    const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(h), 3 * h);
    grid->setSaveFloatAsHalf(true);
    std::ostringstream file(std::ios::binary);
    openvdb::io::Stream(file).write({grid});
    std::istringstream in(file.str(), std::ios::binary);
    const auto grids = openvdb::io::Stream(in).getGrids();
    const LevelSet level_set(grids->front());
    const auto probe = level_set.probe();
    // 11 bits of mantissa: 0.1 is known to 3e-5, the gradient to that over h.
    for (const Vec3& p : near_sphere(500, 0.8 * h)) {
        EXPECT_NEAR(probe->value(p), p.norm() - 1.0, 0.5 * h * h + 6e-5);
        EXPECT_LT((probe->sample(p).gradient - p.normalized()).norm(), 2 * h * h + 3e-3);
    }
    EXPECT_EQ(level_set.value_scale(), 1.0);
}

TEST(LevelSet, ReadsADenseBlockWithFarValues) {
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

TEST(LevelSet, CapsWhatRunsIntoTheBorderOfItsBlockOneVoxelBeyond) {
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

TEST(LevelSet, MeetsTheBorderWhereVolumeToMeshPutsIt) {
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

TEST(LevelSet, CountsValuesThatAreNotFiniteAsOutside) {
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

TEST(LevelSet, HasNoValuesThatAreNotFiniteWhereTheBackgroundIsRight) {
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

TEST(LevelSet, CountsTilesThatAreNotFiniteAsFar) {
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

TEST(LevelSet, RefusesValuesThatCannotBeMadeDistances) {
    const auto grid = dense_block(16, 0.1, [](const Vec3& p) { return p.z() > 0.75 ? 1e-41 : -1e-41; });
    try {
        LevelSet{grid};
        FAIL();
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("hardly differ"), std::string::npos) << error.what();
    }
}

TEST(LevelSet, CountsMinusInfinityAsInside) {
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

TEST(LevelSet, CountsActiveTiles) {
    // The inside of the sphere as active tiles of a constant value, as some writers leave it.
    const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.04), 0.12);
    grid->tree().prune();
    const openvdb::CoordBBox middle(openvdb::Coord(-8), openvdb::Coord(7));
    grid->fill(middle, -0.12f, true);
    ASSERT_GT(grid->tree().activeTileCount(), 0u);
    const LevelSet level_set(grid);
    expect_unit_sphere(level_set, 0.04);
}

TEST(LevelSet, KnowsInsideTiles) {
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

TEST(LevelSet, RefusesAnUnknownClassWithoutSignChange) {
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(10)), 1.0f, true);
    EXPECT_THROW(LevelSet{grid}, InputError);
    LevelSetOptions options;
    options.iso = 2.0;
    EXPECT_THROW(LevelSet(grid, options), InputError);
    const auto nothing = openvdb::FloatGrid::create(1.0f);
    EXPECT_THROW(LevelSet{nothing}, InputError);
}

TEST(LevelSet, AcceptsAnUnknownClassThatChangesSign) {
    const auto grid = sphere_grid<openvdb::FloatGrid>(uniform(0.08), 0.24);
    grid->setGridClass(openvdb::GRID_UNKNOWN);
    expect_unit_sphere(LevelSet(grid), 0.08);
}

TEST(LevelSet, MayBeEmpty) {
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

TEST(LevelSet, RefusesWhatItCannotSample) {
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

TEST(LevelSet, GivesTheSameValuesToEveryThread) {
    const auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(1.0f, openvdb::Vec3f(0.0f), 0.04f, 3.0f);
    const LevelSet level_set(grid);
    const auto points = near_sphere(20000, 0.3);
    const auto ask = [&](std::vector<double>& values) {
        const auto probe = level_set.probe();
        for (const Vec3& p : points) values.push_back(probe->value(p) + probe->sample(p).gradient.sum());
    };
    std::vector<double> expected;
    ask(expected);
    std::vector<std::vector<double>> found(4);
    std::vector<std::thread> threads;
    for (auto& values : found) threads.emplace_back([&] { ask(values); });
    for (auto& thread : threads) thread.join();
    for (const auto& values : found) EXPECT_EQ(values, expected);
}

/// Where volumeToMesh puts the surface: the vertices of its quads, world units.
std::vector<Vec3> volume_to_mesh(const openvdb::FloatGrid& grid) {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(grid, points, quads);
    std::vector<Vec3> result;
    for (const auto& p : points) result.emplace_back(p.x(), p.y(), p.z());
    return result;
}

/// Its vertices are means of the crossings of a cell's edges, so each is within a voxel of some crossing, and
/// the value there within half a voxel of zero, most of them much nearer.
void expect_same_surface(const LevelSet& level_set, const std::vector<Vec3>& vertices) {
    ASSERT_GT(vertices.size(), 50u);
    const auto probe = level_set.probe();
    const auto crossings = level_set.crossings();
    std::vector<double> values;
    for (const Vec3& v : vertices) {
        double nearest = kInf;
        for (const auto& c : crossings) nearest = std::min(nearest, (c.point - v).norm());
        EXPECT_LT(nearest, 1.0 * level_set.voxel_size()) << v.transpose();
        values.push_back(std::abs(probe->value(v)) / level_set.voxel_size());
        EXPECT_LT(values.back(), 0.5) << v.transpose();
    }
    for (const auto& c : crossings) {
        double nearest = kInf;
        for (const Vec3& v : vertices) nearest = std::min(nearest, (c.point - v).norm());
        EXPECT_LT(nearest, 1.0 * level_set.voxel_size()) << c.point.transpose();
    }
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    EXPECT_LT(values[values.size() / 2], 0.05);
}

TEST(LevelSetOfRealFiles, PutsTheBoxWhereVolumeToMeshDoes) {
    const std::string path = ISOTRACK_SHARED_DATA "/vdb/levelset_box_unnamed_wide_band_v223.vdb";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
    const auto grid =
        openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(path, choose_grid(list_grids(path), {}, path)));
    const LevelSet level_set(grid);
    EXPECT_EQ(level_set.value_scale(), 0.5);
    expect_same_surface(level_set, volume_to_mesh(*grid));
}

TEST(LevelSetOfRealFiles, PutsLiquidWhereVolumeToMeshDoes) {
    for (const char* frame : {"0001", "0020", "0040"}) {
        const std::string path =
            std::string(ISOTRACK_SHARED_DATA "/vdb-sequences/liquid_waterfall_frames_0001-0040/fluid_data_") +
            frame + ".vdb";
        if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
        const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(
            read_grid(path, choose_grid(list_grids(path), "phi", path)));
        const LevelSet level_set(grid);
        EXPECT_EQ(level_set.value_scale(), level_set.voxel_size());
        expect_same_surface(level_set, volume_to_mesh(*grid));
    }
}

TEST(LevelSet, TakesTheDistancesOfAThinShellForWhatTheyAre) {
    // A wall of one voxel: central differences across it are about half as long as the gradient.
    const double voxel = 0.05;
    for (const double unit : {1.0, voxel}) {
        const auto grid = openvdb::FloatGrid::create(static_cast<float>(3.0 * voxel / unit));
        grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
        grid->setGridClass(openvdb::GRID_LEVEL_SET);
        auto access = grid->getAccessor();
        for (int x = -20; x <= 20; ++x)
            for (int y = -20; y <= 20; ++y)
                for (int z = -20; z <= 20; ++z) {
                    const double r = voxel * std::sqrt(double(x * x + y * y + z * z));
                    const double value = std::abs(r - 0.6) - 0.5 * voxel;
                    if (value < 3.0 * voxel) access.setValue({x, y, z}, static_cast<float>(value / unit));
                }
        EXPECT_DOUBLE_EQ(LevelSet(grid).value_scale(), unit);
    }
}

}  // namespace
}  // namespace isotrack
