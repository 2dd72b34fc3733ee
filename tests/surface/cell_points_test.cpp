// Cell points against the vertices of OpenVDB's dual mesh.
#include "surface/cell_points.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr double kVoxel = 0.05;

/// A torus and a tilted box, and how far from the origin: there many nodes are on the torus.
struct Solids : ::testing::TestWithParam<double> {
    Solids() {
        Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
        turn.rotate(Eigen::AngleAxisd(0.7, Vec3(1.0, 2.0, 3.0).normalized()));
        const auto solids =
            shapes::unite({shapes::torus(Vec3::Constant(GetParam()), 1.0, 0.3, kVoxel),
                           shapes::moved(shapes::box({0, 0, 0}, {0.4, 0.25, 0.3}, kVoxel), turn)});
        surface.emplace(rasterise(*solids, kVoxel));
        crossings.emplace(*surface);
        all.resize(crossings->size());
        std::iota(all.begin(), all.end(), 0);
    }
    std::optional<LevelSet> surface;
    std::optional<CrossingGrid> crossings;
    std::vector<int> all;
};

TEST_P(Solids, HaveThemWhereTheDualMeshHasItsVertices) {
    std::vector<openvdb::Vec3s> vertices;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*surface->grid(), vertices, quads);
    const auto points = CellPoints(*surface, *crossings, surface->diagonals()).around(all);
    const CrossingGrid grid(Surface::CrossingSequence(points), kVoxel);
    std::vector<char> met(points.size(), 0);
    for (const openvdb::Vec3s& v : vertices) {
        const Vec3 vertex(v.x(), v.y(), v.z()), reach = Vec3::Constant(1e-4 * kVoxel);
        int there = 0;
        grid.for_each_in(Box(vertex - reach, vertex + reach), [&](std::size_t c) {
            met[c] = 1;
            ++there;
        });
        EXPECT_EQ(there, 1) << vertex.transpose();
    }
    EXPECT_EQ(std::count(met.begin(), met.end(), 0), 0);
}

/// Random values on a few nodes: many ambiguous faces, cells with up to twelve crossings.
TEST(CellPoints, AreTheVerticesOfVolumeToMeshAtAmbiguousFaces) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> value(-0.5f, 0.5f);
    const auto grid = openvdb::FloatGrid::create(1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    for (int x = -1; x <= 12; ++x)
        for (int y = -1; y <= 12; ++y)
            for (int z = -1; z <= 12; ++z) {
                const bool rim = std::min({x, y, z}) < 0 || std::max({x, y, z}) > 11;
                grid->tree().setValue({x, y, z}, rim ? 1.0f : value(random));
            }
    std::vector<openvdb::Vec3s> vertices;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*grid, vertices, quads);
    const LevelSet surface(grid);
    const CrossingGrid crossings(surface);
    std::vector<int> all(crossings.size());
    std::iota(all.begin(), all.end(), 0);
    const auto points = CellPoints(surface, crossings, surface.diagonals()).around(all);
    EXPECT_EQ(points.size(), vertices.size());
    const CrossingGrid found(Surface::CrossingSequence(points), 1.0);
    for (const openvdb::Vec3s& v : vertices) {
        const Vec3 vertex(v.x(), v.y(), v.z()), reach = Vec3::Constant(1e-4);
        bool any = false;
        found.for_each_in(Box(vertex - reach, vertex + reach), [&](std::size_t) { any = true; });
        EXPECT_TRUE(any) << vertex.transpose();
    }
}

TEST_P(Solids, GoOutwards) {
    const auto points = CellPoints(*surface, *crossings, surface->diagonals()).around(all);
    const auto probe = surface->probe();
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Vec3 outward = points[i].outward.cast<double>();
        EXPECT_NEAR(outward.norm(), 1.0, 1e-6);
        EXPECT_GT(outward.dot(probe->normal(points.point(i))), 0.3) << points.point(i).transpose();
    }
}

/// A cube whose outermost nodes are inside by rounding alone: every crossing is next to one of them.
TEST(CellPoints, AreFoundFromNodesThatAreInsideByRounding) {
    constexpr int kHalf = 5;
    const auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-8), openvdb::Coord(8)).begin(); c; ++c) {
        const int depth = std::max({std::abs((*c).x()), std::abs((*c).y()), std::abs((*c).z())}) - kHalf;
        grid->tree().setValue(*c, depth == 0 ? -1e-9f : static_cast<float>(std::clamp(depth, -3, 3)));
    }
    const LevelSet surface(grid);
    const CrossingGrid crossings(surface);
    std::vector<int> all(crossings.size());
    std::iota(all.begin(), all.end(), 0);
    ASSERT_EQ(all.size(), 6u * 11 * 11);
    const auto points = CellPoints(surface, crossings, surface.diagonals()).around(all);
    EXPECT_EQ(points.size(), 12u * 12 * 12 - 10 * 10 * 10);  // all cells with corners on both sides
    for (std::size_t i = 0; i < points.size(); ++i)
        EXPECT_NEAR(points.point(i).lpNorm<Eigen::Infinity>(), kHalf, 1e-5);
}

TEST_P(Solids, HaveEachOfThemOnce) {
    CellPoints cells(*surface, *crossings, surface->diagonals());
    const std::vector<int> some(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 3));
    const std::size_t at_first = cells.around(some).size(), then = cells.around(all).size();
    EXPECT_GT(at_first, some.size() / 3);
    EXPECT_GT(then, 0u);
    EXPECT_EQ(cells.around(all).size(), 0u);
    EXPECT_EQ(at_first + then, CellPoints(*surface, *crossings, surface->diagonals()).around(all).size());
}

INSTANTIATE_TEST_SUITE_P(Places, Solids, ::testing::Values(0.0, 0.0221, 0.0137));

}  // namespace
}  // namespace isotrack
