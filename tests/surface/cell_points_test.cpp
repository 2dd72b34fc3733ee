// Cell points against the vertices of OpenVDB's dual mesh.
#include "surface/cell_points.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <numeric>
#include <optional>
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
    const auto points = CellPoints(*crossings, surface->lattice()).around(all);
    const CrossingGrid grid(points, kVoxel);
    const auto near = [&](const openvdb::Vec3s& v, double distance) {
        const Vec3 vertex(v.x(), v.y(), v.z()), reach = Vec3::Constant(distance);
        std::vector<std::size_t> result;
        grid.for_each_in(Box(vertex - reach, vertex + reach), [&](std::size_t c) { result.push_back(c); });
        return result;
    };
    std::vector<char> met(points.size(), 0);
    std::vector<openvdb::Vec3s> joined;
    for (const openvdb::Vec3s& v : vertices) {
        const auto there = near(v, 1e-4 * kVoxel);
        EXPECT_LE(there.size(), 1u);
        for (const std::size_t c : there) met[c] = 1;
        if (there.empty()) joined.push_back(v);
    }
    // In cells with an ambiguous face OpenVDB may join what is two parts here.
    EXPECT_LT(joined.size(), vertices.size() / 100);
    std::size_t parted = 0;
    for (const openvdb::Vec3s& v : joined) {
        const auto around = near(v, kVoxel);
        EXPECT_GE(std::count_if(around.begin(), around.end(), [&](std::size_t c) { return !met[c]; }), 2);
    }
    for (const char flag : met) parted += !flag;
    EXPECT_EQ(parted, 2 * joined.size());
}

TEST_P(Solids, HaveEachOfThemOnce) {
    CellPoints cells(*crossings, surface->lattice());
    const std::vector<int> some(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 3));
    const std::size_t at_first = cells.around(some).size(), then = cells.around(all).size();
    EXPECT_GT(at_first, some.size() / 3);
    EXPECT_GT(then, 0u);
    EXPECT_TRUE(cells.around(all).empty());
    EXPECT_EQ(at_first + then, CellPoints(*crossings, surface->lattice()).around(all).size());
}

INSTANTIATE_TEST_SUITE_P(Places, Solids, ::testing::Values(0.0, 0.0221, 0.0137));

}  // namespace
}  // namespace isotrack
