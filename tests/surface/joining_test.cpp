// Nodes across the diagonals of lattice faces: the surface joins what volumeToMesh joins.
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "isotrack/meshing/lattice_topology.h"
#include "isotrack/surface/level_set.h"
#include "support/meshes.h"
#include "surface/ambiguous_faces.h"

namespace isotrack {
namespace {

using openvdb::Coord;

TEST(InsideCorners, AreThoseWithValuesBelowZero) {
    const float some[] = {-1.0f, 1.0f, 0.0f, -0.0f, -1e-45f, std::nanf(""), -INFINITY, INFINITY};
    std::mt19937 random(5);
    for (int trial = 0; trial < 1000; ++trial) {
        float values[2][2][2];
        unsigned expected = 0;
        for (unsigned c = 0; c < 8; ++c) {
            const float value = some[random() % 8];
            values[c >> 2][c >> 1 & 1][c & 1] = value;
            if (value < 0.0f) expected += 1u << c;
        }
        EXPECT_EQ(inside_corners(values), expected);
    }
}

/// Random values at nodes, with outside around them.
openvdb::FloatGrid::Ptr random_grid(unsigned seed, int nodes, double share_inside, float least = 0.02f,
                                    float most = 1.0f) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> size(least, most);
    std::bernoulli_distribution inside(share_inside);
    const auto grid = openvdb::FloatGrid::create(1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    for (auto c = openvdb::CoordBBox(Coord(-2), Coord(nodes + 2)).begin(); c; ++c) {
        const bool border = (*c)[0] < 1 || (*c)[1] < 1 || (*c)[2] < 1 || (*c)[0] > nodes || (*c)[1] > nodes ||
                            (*c)[2] > nodes;
        const float value = size(random);
        grid->tree().setValueOn(*c, !border && inside(random) ? -value : value);
    }
    return grid;
}

/// Components of what volumeToMesh makes of a grid.
int components(const openvdb::FloatGrid& grid) {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(grid, points, quads);
    std::vector<int> parent(points.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto find = [&](int v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const auto& q : quads)
        for (int k = 1; k < 4; ++k) parent[find(static_cast<int>(q[k]))] = find(static_cast<int>(q[0]));
    int count = 0;
    for (std::size_t v = 0; v < points.size(); ++v) count += find(static_cast<int>(v)) == static_cast<int>(v);
    return count;
}

/// The level set sampled `times` as densely.
openvdb::FloatGrid::Ptr refined(const LevelSet& level_set, int nodes, int times) {
    const auto grid = openvdb::FloatGrid::create(1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    const auto probe = level_set.probe();
    for (auto c = openvdb::CoordBBox(Coord(-times), Coord((nodes + 1) * times)).begin(); c; ++c)
        grid->tree().setValueOn(*c, static_cast<float>(probe->value(Vec3((*c)[0], (*c)[1], (*c)[2]) /
                                                                    static_cast<double>(times))));
    return grid;
}

TEST(Joining, TheFartherValueIsTheTrilinearOneWhereThatIsFartherByUpToTwice) {
    const LevelSet level_set(random_grid(7, 8, 0.4));
    const auto probe = level_set.probe();
    using Sampler = openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler>;
    const Sampler trilinear(*level_set.grid());
    std::mt19937 random(1);
    std::uniform_real_distribution<double> within(-1.0, 10.0);
    int farther = 0, nearer = 0, parted = 0;
    for (int trial = 0; trial < 100000; ++trial) {
        const Vec3 p(within(random), within(random), within(random));
        const double value = probe->value(p), plain = trilinear.wsSample(openvdb::Vec3d(p.x(), p.y(), p.z()));
        const bool same_side = (value < 0.0) == (plain < 0.0);
        const double expected =
            same_side && std::abs(plain) > std::abs(value) && std::abs(value) > 0.5 * std::abs(plain) ? plain
                                                                                                      : value;
        constexpr double kInBand = 0.8;  // of 1: beyond it distances are others
        if (!(std::abs(expected) < kInBand)) continue;
        EXPECT_NEAR(probe->farther_value(p), expected, 1e-6);
        if (std::abs(value - plain) < 1e-6) continue;
        (!same_side ? parted : expected == plain ? farther : nearer) += 1;
    }
    EXPECT_GT(farther, 100);
    EXPECT_GT(nearer, 100);
    EXPECT_GT(parted, 100);
}

TEST(Joining, TheSurfaceHasTheComponentsOfVolumeToMesh) {
    constexpr int kNodes = 5, kTimes = 12;
    int same = 0, differ = 0;
    for (unsigned seed = 0; seed < 24; ++seed) {
        const auto grid = random_grid(seed, kNodes, seed % 2 ? 0.15 : 0.3, 0.3f, 0.5f);
        const LevelSet level_set(grid);
        const int coarse = components(*level_set.grid()),
                  fine = components(*refined(level_set, kNodes, kTimes));
        (coarse == fine ? same : differ) += 1;
    }
    EXPECT_EQ(differ, 0) << "of " << same + differ;
}

TEST(Joining, DiagonalsDoNotCrossTheSurface) {
    std::size_t inside = 0, outside = 0;
    for (unsigned seed = 0; seed < 20; ++seed) {
        const LevelSet level_set(random_grid(seed, 6, 0.4));
        const auto probe = level_set.probe();
        for (const Surface::Diagonal& d : level_set.diagonals()) {
            const bool side = probe->value(d.from) < 0.0;
            ++(side ? inside : outside);
            for (int i = 0; i <= 20; ++i)
                EXPECT_EQ(probe->value(d.from + (d.to - d.from) * (i / 20.0)) < 0.0, side);
            EXPECT_NEAR((d.to - d.from).norm(), std::sqrt(2.0), 1e-9);
            for (const Vec3& p : d.beside)
                EXPECT_LT((p - 0.5 * (d.from + d.to)).norm(), std::sqrt(0.5) + 1e-9);
        }
    }
    EXPECT_GT(inside, 50u);
    EXPECT_GT(outside, 50u);
}

TEST(Joining, KnowsEveryFaceWithTwoInsideNodesAcrossADiagonal) {
    // Nodes over several leaves of the grid, which has others beyond them.
    constexpr int kNodes = 18;
    const auto grid = random_grid(3, kNodes, 0.4);
    const auto reader = grid->getConstAccessor();
    const auto is_inside = [&](const Coord& c) { return reader.getValue(c) < 0.0f; };
    std::set<std::array<int, 3>> centres, found;  // of the faces, doubled
    for (auto c = openvdb::CoordBBox(Coord(-2), Coord(kNodes + 3)).begin(); c; ++c)
        for (int out = 0; out < 3; ++out) {
            Coord u(0), w(0);
            u[(out + 1) % 3] = w[(out + 2) % 3] = 1;
            const bool side = is_inside(*c);
            if (is_inside(*c + u + w) == side && is_inside(*c + u) != side && is_inside(*c + w) != side)
                centres.insert(
                    {2 * (*c)[0] + u[0] + w[0], 2 * (*c)[1] + u[1] + w[1], 2 * (*c)[2] + u[2] + w[2]});
        }
    for (const Surface::Diagonal& d : LevelSet(grid).diagonals()) {
        const Vec3 sum = d.from + d.to;
        found.insert({static_cast<int>(std::lround(sum.x())), static_cast<int>(std::lround(sum.y())),
                      static_cast<int>(std::lround(sum.z()))});
    }
    EXPECT_GT(centres.size(), 1000u);
    EXPECT_EQ(found, centres);
}

TEST(Joining, IsContinuousAndKeepsNodesAndEdges) {
    const auto grid = random_grid(7, 6, 0.4);
    const LevelSet level_set(grid);
    const auto probe = level_set.probe();
    const auto reader = grid->getConstAccessor();
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(0.0, 7.0), part(0.0, 1.0);
    double largest_step = 0.0;
    for (int trial = 0; trial < 20000; ++trial) {
        Vec3 p(place(random), place(random), place(random));
        const int axis = trial % 3;
        p[axis] = std::round(p[axis]);  // on a face between cells
        Vec3 below = p, above = p;
        below[axis] -= 1e-9;
        above[axis] += 1e-9;
        largest_step = std::max(largest_step, std::abs(probe->value(below) - probe->value(above)));
        EXPECT_NEAR(probe->value(below), probe->sample(below).value, 1e-6);
        // Along edges the value is linear between the nodes'.
        Coord from(static_cast<int>(p.x()), static_cast<int>(p.y()), static_cast<int>(p.z())), to = from;
        to[axis] += 1;
        const double t = part(random);
        Vec3 on_edge(from[0], from[1], from[2]);
        on_edge[axis] += t;
        EXPECT_NEAR(probe->value(on_edge), (1.0 - t) * reader.getValue(from) + t * reader.getValue(to), 1e-6);
    }
    EXPECT_LT(largest_step, 1e-6);
}

TEST(LatticeTopology, SaysWhichDiagonalsTheMeshParts) {
    // Two nodes across a face with so much inside beside them that volumeToMesh joins them.
    const auto grid = openvdb::FloatGrid::create(1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    for (auto c = openvdb::CoordBBox(Coord(-4), Coord(5)).begin(); c; ++c) grid->tree().setValueOn(*c, 0.5f);
    for (const Coord& c :
         {Coord(0, 0, 0), Coord(0, 1, 1), Coord(-1, 0, 0), Coord(-1, 1, 1), Coord(1, 0, 0), Coord(1, 1, 1)})
        grid->tree().setValueOn(c, -0.3f);
    const LevelSet level_set(grid);
    ASSERT_EQ(level_set.diagonals().size(), 3u);
    const LatticeSides sides(level_set);
    const auto bar = [](const Vec3& at) {
        TriangleMesh mesh = support::icosphere(3, {0, 0, 0}, 1.0);
        for (Vec3& p : mesh.points) p = at + p.cwiseProduct(Vec3(1.6, 0.45, 0.45));
        return mesh;
    };
    const TriangleMesh apart = support::join(bar({0, 0, 0}), bar({0, 1, 1}));
    TriangleMesh together = support::icosphere(4, {0, 0, 0}, 1.0);
    for (Vec3& p : together.points) p = Vec3(0, 0.5, 0.5) + p.cwiseProduct(Vec3(1.6, 1.2, 1.2));
    EXPECT_TRUE(lattice_topology(together.points, together.triangles, sides).parted.empty());
    const bool joined = level_set.probe()->value(Vec3(0, 0.5, 0.5)) < 0.0;
    EXPECT_EQ(lattice_topology(apart.points, apart.triangles, sides).parted.empty(), !joined);
}

}  // namespace
}  // namespace isotrack
