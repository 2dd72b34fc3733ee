// Cell points against the vertices of OpenVDB's dual mesh.
#include "surface/cell_points.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
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
    const auto has_node_just_inside = [&](const Vec3& vertex) {
        const Vec3 low = (surface->lattice().inverse() * vertex).array().floor();
        for (int k = 0; k < 8; ++k) {
            const openvdb::Coord node(static_cast<int>(low.x()) + (k & 1),
                                      static_cast<int>(low.y()) + (k >> 1 & 1),
                                      static_cast<int>(low.z()) + (k >> 2));
            const float value = surface->grid()->tree().getValue(node);
            if (value < 0.0f && value > -1e-6f * static_cast<float>(kVoxel)) return true;
        }
        return false;
    };
    std::vector<char> met(points.size(), 0);
    std::size_t missed = 0;
    for (const openvdb::Vec3s& v : vertices) {
        const Vec3 vertex(v.x(), v.y(), v.z()), reach = Vec3::Constant(1e-4 * kVoxel);
        int there = 0;
        grid.for_each_in(Box(vertex - reach, vertex + reach), [&](std::size_t c) {
            met[c] = 1;
            ++there;
        });
        // The crossings next to a node that is inside by rounding alone are all on it.
        EXPECT_TRUE(there == 1 || has_node_just_inside(vertex)) << vertex.transpose();
        missed += there != 1;
    }
    EXPECT_LT(missed, vertices.size() / 100);
    EXPECT_EQ(std::count(met.begin(), met.end(), 0), 2 * static_cast<std::ptrdiff_t>(missed));
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

TEST_P(Solids, HaveEachOfThemOnce) {
    CellPoints cells(*surface, *crossings, surface->diagonals());
    const std::vector<int> some(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 3));
    const std::size_t at_first = cells.around(some).size(), then = cells.around(all).size();
    EXPECT_GT(at_first, some.size() / 3);
    EXPECT_GT(then, 0u);
    EXPECT_TRUE(cells.around(all).empty());
    EXPECT_EQ(at_first + then, CellPoints(*surface, *crossings, surface->diagonals()).around(all).size());
}

INSTANTIATE_TEST_SUITE_P(Places, Solids, ::testing::Values(0.0, 0.0221, 0.0137));

}  // namespace
}  // namespace isotrack
