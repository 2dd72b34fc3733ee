// Level sets held against the sphere (or box) they were made from, under transforms and in units of all
// kinds.
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

#include "isotrack/io/vdb_file.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/sphere_grid.h"
#include "support/unit_sphere.h"

namespace isotrack {
namespace {

using support::expect_unit_sphere;
using support::near_sphere;
using support::sphere_grid;
using support::uniform;
constexpr double kInf = std::numeric_limits<double>::infinity();

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

TEST(LevelSet, HasTheSameFartherValuesAtManyPointsAtOnce) {
    // Through more leaves than a probe keeps at hand, in and far beyond the band, in tiles and outside.
    const LevelSet level_set(sphere_grid<openvdb::FloatGrid>(uniform(0.02), 0.06));
    std::mt19937 random(7);
    std::uniform_real_distribution<double> coordinate(-1.3, 1.3);
    std::vector<Vec3> points = near_sphere(1000, 0.1);
    for (int n = 0; n < 1000; ++n)
        points.emplace_back(coordinate(random), coordinate(random), coordinate(random));
    points.emplace_back(1e300, 0.0, 0.0);
    std::vector<double> at_once(points.size());
    level_set.probe()->farther_values(points.data(), points.size(), at_once.data());
    const auto probe = level_set.probe();
    for (std::size_t n = 0; n < points.size(); ++n)
        EXPECT_EQ(at_once[n], probe->farther_value(points[n])) << points[n].transpose();
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

/// The corners of cells anywhere, in the band and in tiles, against the grid's own values.
TEST(LevelSet, HasTheValuesOfItsNodesAtTheCornersOfCells) {
    const auto transform = uniform(0.05);
    transform->postRotate(0.4, openvdb::math::Y_AXIS);
    transform->postTranslate({0.3, -2.0, 0.1});
    const auto grid = sphere_grid<openvdb::FloatGrid>(transform, 0.15);
    const LevelSet level_set(grid);
    const auto probe = level_set.probe();
    const auto accessor = level_set.grid()->getConstAccessor();
    std::mt19937 random(6);
    std::uniform_int_distribution<int> coordinate(-30, 30);
    const openvdb::Coord middle = openvdb::Coord::round(transform->worldToIndex({0.0, 0.0, 0.0}));
    int crossed = 0;
    for (int i = 0; i < 5000; ++i) {
        const openvdb::Coord low =
            middle + openvdb::Coord(coordinate(random), coordinate(random), coordinate(random));
        const auto values = probe->cell_values(Vec3(low.x(), low.y(), low.z()), level_set.lattice());
        for (int k = 0; k < 8; ++k)
            ASSERT_EQ(values[k], accessor.getValue(low.offsetBy(k & 1, k >> 1 & 1, k >> 2)))
                << low << ' ' << k;
        const auto [least, most] = std::minmax_element(values.begin(), values.end());
        crossed += *least < 0.0 && *most >= 0.0;
    }
    EXPECT_GT(crossed, 50);
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
