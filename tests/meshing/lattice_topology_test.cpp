// Meshes whose topology is known, held against the signs at the nodes of a lattice.
#include "isotrack/meshing/lattice_topology.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "isotrack/compare/baselines.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/shapes.h"
#include "meshing/lattice_neighbours.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

using support::icosphere;
using support::join;
using support::torus;

LatticeTopology topology_of(const TriangleMesh& mesh, const Surface& surface) {
    return lattice_topology(mesh.points, mesh.triangles, LatticeSides(surface));
}

bool has_specks(const LatticeTopology& topology) {
    return std::count(topology.speck.begin(), topology.speck.end(), 1) > 0;
}

TEST(LatticeTopology, HasNoFaultsWhereOnlyNodesNearTheSurfaceAreOnTheWrongSide) {
    const auto surface = shapes::sphere({0.03, 0.01, -0.02}, 1.0, 0.1);
    for (const double radius : {0.93, 0.97, 1.0, 1.03, 1.07}) {
        const LatticeTopology found = topology_of(icosphere(3, {0.03, 0.01, -0.02}, radius), *surface);
        EXPECT_TRUE(found.faults.empty()) << radius;
        EXPECT_FALSE(has_specks(found));
    }
}

TEST(LatticeTopology, FindsAHandleTooManyAndOneTooFew) {
    const auto ball = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const auto ring = shapes::torus({0, 0, 0}, 1.0, 0.4, 0.1);
    EXPECT_FALSE(topology_of(torus(60, 30, 0.7, 0.3), *ball).faults.empty());
    EXPECT_FALSE(topology_of(icosphere(3, {0, 0, 0}, 1.3), *ring).faults.empty());
    EXPECT_TRUE(topology_of(torus(60, 30), *ring).faults.empty());
}

TEST(LatticeTopology, FindsABridgeInTheGapItCrosses) {
    // Two balls with a gap of three nodes, and a mesh that is one long body over both.
    const auto surface =
        shapes::unite({shapes::sphere({-0.65, 0, 0}, 0.5, 0.1), shapes::sphere({0.65, 0, 0}, 0.5, 0.1)});
    const TriangleMesh apart = join(icosphere(3, {-0.65, 0, 0}, 0.49), icosphere(3, {0.65, 0, 0}, 0.49));
    EXPECT_TRUE(topology_of(apart, *surface).faults.empty());
    TriangleMesh dumbbell = icosphere(5);
    for (Vec3& p : dumbbell.points) {
        const double x = 1.15 * p.x(), to_centre = std::abs(x) - 0.65, across = std::hypot(p.y(), p.z());
        const double ball = std::sqrt(std::max(0.0, 0.25 - to_centre * to_centre));
        const double rho = std::max(ball, to_centre < 0.0 ? 0.15 : 0.0) / std::max(across, 1e-9);
        p = Vec3(x, rho * p.y(), rho * p.z());
    }
    const LatticeTopology found = topology_of(dumbbell, *surface);
    ASSERT_FALSE(found.faults.empty());
    for (const Vec3& f : found.faults) EXPECT_LT(std::abs(f.x()), 0.3);
}

TEST(LatticeTopology, FindsAComponentThatIsMissingAndOneThatIsTooMany) {
    const auto one = shapes::sphere({0, 0, 0}, 0.5, 0.1);
    const auto two = shapes::unite({one, shapes::sphere({1.5, 0, 0}, 0.3, 0.1)});
    const TriangleMesh ball = icosphere(3, {0, 0, 0}, 0.5),
                       balls = join(ball, icosphere(3, {1.5, 0, 0}, 0.3));
    EXPECT_TRUE(topology_of(balls, *two).faults.empty());
    const LatticeTopology missing = topology_of(ball, *two), extra = topology_of(balls, *one);
    ASSERT_FALSE(missing.faults.empty());
    for (const Vec3& f : missing.faults) EXPECT_LT((f - Vec3(1.5, 0, 0)).norm(), 0.3);
    ASSERT_FALSE(extra.faults.empty());
    for (const Vec3& f : extra.faults) EXPECT_LT((f - Vec3(1.5, 0, 0)).norm(), 0.3);
}

TEST(LatticeTopology, CallsAComponentWithoutANodeASpeck) {
    const auto surface = shapes::sphere({0, 0, 0}, 0.5, 0.1);
    const TriangleMesh ball = icosphere(3, {0, 0, 0}, 0.5);
    const Eigen::Affine3d lattice = surface->lattice();
    const Vec3 node = lattice * Vec3(1, 1, 1), between = lattice * Vec3(0.5, 0.5, 0.5);
    const LatticeTopology speck = topology_of(join(ball, icosphere(1, between, 0.04)), *surface);
    EXPECT_TRUE(speck.faults.empty());
    ASSERT_EQ(speck.speck.size(), ball.triangles.size() + 80);
    for (std::size_t t = 0; t < speck.speck.size(); ++t)
        EXPECT_EQ(speck.speck[t], t >= ball.triangles.size());
    const LatticeTopology island = topology_of(join(ball, icosphere(1, node, 0.04)), *surface);
    EXPECT_FALSE(has_specks(island));
    ASSERT_EQ(island.faults.size(), 1u);
    EXPECT_LT((island.faults[0] - node).norm(), 1e-9);
}

TEST(LatticeTopology, HoldsForMeshesAlignedWithTheLattice) {
    // Faces in the planes of the nodes: a node on the surface counts as outside, whichever way the mesh has
    // it.
    const auto surface = shapes::box({0, 0, 0}, {0.5, 0.4, 0.3}, 0.1);
    TriangleMesh mesh;
    for (int i = 0; i < 8; ++i)
        mesh.points.emplace_back(i & 1 ? 0.5 : -0.5, i & 2 ? 0.4 : -0.4, i & 4 ? 0.3 : -0.3);
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    const LatticeTopology found = topology_of(mesh, *surface);
    EXPECT_TRUE(found.faults.empty());
    EXPECT_FALSE(has_specks(found));
}

/// A grid whose inside nodes are these.
LevelSet level_set_of(const std::vector<openvdb::Coord>& inside) {
    const auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-8), openvdb::Coord(8)).begin(); c; ++c)
        grid->tree().setValueOn(*c, 0.6f);
    for (const openvdb::Coord& c : inside) grid->tree().setValueOn(c, -0.4f);
    return LevelSet(grid);
}

/// An ellipsoid of round cross section around the nodes from `low` to `high`, which share a line or are one.
TriangleMesh body_around(const Vec3& low, const Vec3& high) {
    TriangleMesh mesh = icosphere(3, {0, 0, 0}, 1.0);
    const Vec3 half = 0.5 * (high - low);
    const Vec3 axes = (half.array() > 0.0).select((half.array() + 0.4).matrix(), Vec3::Constant(0.35));
    for (Vec3& p : mesh.points) p = 0.5 * (low + high) + p.cwiseProduct(axes);
    return mesh;
}

std::vector<char> specks_of(const std::vector<TriangleMesh>& bodies, const LevelSet& level_set) {
    TriangleMesh mesh = bodies[0];
    for (std::size_t b = 1; b < bodies.size(); ++b) mesh = join(mesh, bodies[b]);
    const LatticeTopology found = topology_of(mesh, level_set);
    std::vector<char> result;
    std::size_t t = 0;
    for (const TriangleMesh& body : bodies) {
        const auto count = static_cast<long>(body.triangles.size());
        const auto flagged = std::count_if(found.speck.begin() + static_cast<long>(t),
                                           found.speck.begin() + static_cast<long>(t) + count,
                                           [](char flag) { return flag != 0; });
        EXPECT_TRUE(flagged == 0 || flagged == count);
        result.push_back(flagged > 0);
        t += body.triangles.size();
    }
    return result;
}

TEST(LatticeTopology, CallsASmallPartThatIsTornOffASpeck) {
    std::vector<openvdb::Coord> row;
    for (int x = -6; x <= 4; ++x) row.emplace_back(x, 0, 0);
    const LevelSet rod = level_set_of(row);
    const TriangleMesh most = body_around({-6, 0, 0}, {0, 0, 0});
    EXPECT_EQ(specks_of({most, body_around({1, 0, 0}, {4, 0, 0})}, rod), (std::vector<char>{0, 1}));
    // Nodes between them that nobody holds join them as well.
    EXPECT_EQ(specks_of({most, body_around({3, 0, 0}, {4, 0, 0})}, rod), (std::vector<char>{0, 1}));
    // Of two that are torn off each other the one with fewer nodes is.
    row.assign({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}});
    const TriangleMesh one = body_around({0, 0, 0}, {0, 0, 0}), two = body_around({1, 0, 0}, {2, 0, 0});
    EXPECT_EQ(specks_of({two, one}, level_set_of(row)), (std::vector<char>{0, 1}));
    EXPECT_EQ(specks_of({one, two}, level_set_of(row)), (std::vector<char>{1, 0}));
    // What is on its own is none, nor is what is large.
    row.erase(row.begin() + 1);
    EXPECT_EQ(specks_of({one, body_around({2, 0, 0}, {2, 0, 0})}, level_set_of(row)),
              (std::vector<char>{0, 0}));
    row.clear();
    for (int x = -7; x <= 7; ++x) row.emplace_back(x, 0, 0);
    EXPECT_EQ(specks_of({body_around({-7, 0, 0}, {-1, 0, 0}), body_around({1, 0, 0}, {7, 0, 0})},
                        level_set_of(row)),
              (std::vector<char>{0, 0}));
}

TEST(LatticeTopology, LooksAtManyPartsAsIfOneAfterTheOther) {
    // Rods of three nodes, over each other and side by side, all torn in two: the part with one node is, and
    // then the other hangs on nothing any more.
    std::vector<openvdb::Coord> inside;
    std::vector<TriangleMesh> bodies;
    std::vector<char> torn;
    for (int y = 0; y < 30; y += 6)
        for (int z = 0; z < 48; z += 6) {
            for (int x = 0; x <= 2; ++x) inside.emplace_back(x, y, z);
            bodies.push_back(body_around(Vec3(1, y, z), Vec3(2, y, z)));
            bodies.push_back(body_around(Vec3(0, y, z), Vec3(0, y, z)));
            torn.insert(torn.end(), {0, 1});
        }
    EXPECT_EQ(specks_of(bodies, level_set_of(inside)), torn);
}

TEST(LatticeTopology, TakesNoVoidForTornOff) {
    // A ball with a void of three nodes, of which the mesh has four.
    std::vector<openvdb::Coord> inside;
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-5), openvdb::Coord(5)).begin(); c; ++c) {
        const bool is_void = (*c)[0] >= 0 && (*c)[0] <= 2 && (*c)[1] == 0 && (*c)[2] == 0;
        if ((*c).asVec3d().length() < 5.4 && !is_void) inside.push_back(*c);
    }
    TriangleMesh hole = body_around({0, 0, 0}, {3, 0, 0});
    for (Triangle& t : hole.triangles) std::swap(t[1], t[2]);
    EXPECT_EQ(specks_of({icosphere(4, {0, 0, 0}, 5.4), hole}, level_set_of(inside)),
              (std::vector<char>{0, 0}));
}

TEST(LatticeTopology, TakesPartsForTornOffWhereVolumeToMeshJoinsThem) {
    std::mt19937 random(11);
    int apart = 0, joined = 0;
    for (int trial = 0; trial < 200; ++trial) {
        // Two nodes across a face or a cell, each with some of the nodes behind it.
        const openvdb::Coord to(1, 1, trial % 3 == 0);
        std::vector<openvdb::Coord> inside = {{0, 0, 0}, to};
        std::vector<TriangleMesh> bodies = {body_around({0, 0, 0}, {0, 0, 0}),
                                            body_around(Vec3(1, 1, to.z()), Vec3(1, 1, to.z()))};
        for (const int end : {0, 1})
            if (random() % 2) {
                const int z = end * to.z(), step = end == 0 && to.z() ? -1 : random() % 2 ? 1 : -1;
                inside.emplace_back(end, end, z + step);
                bodies[end] =
                    body_around(Vec3(end, end, std::min(z, z + step)), Vec3(end, end, std::max(z, z + step)));
            }
        const LevelSet level_set = level_set_of(inside);
        const bool is_one = mesh_topology(volume_to_mesh(level_set)).components == 1;
        const std::vector<char> specks = specks_of(bodies, level_set);
        EXPECT_EQ(specks[0] + specks[1], is_one ? 1 : 0) << trial;
        ++(is_one ? joined : apart);
    }
    EXPECT_GT(apart, 10);
    EXPECT_GT(joined, 10);
}

TEST(LatticeTopology, CountsAComponentThatVolumeToMeshPartsFromOthersAsMissing) {
    std::mt19937 random(3);
    int parted = 0, joined = 0;
    for (int trial = 0; trial < 200; ++trial) {
        // A slab with a rough layer on it, and a node that shares an edge or a corner with others, but no
        // face.
        std::vector<openvdb::Coord> inside;
        for (int x = -4; x <= 4; ++x)
            for (int y = -4; y <= 4; ++y) {
                for (int z = -2; z < 0; ++z) inside.emplace_back(x, y, z);
                if ((x != 0 || y != 0) && random() % 100 < 30) inside.emplace_back(x, y, 0);
            }
        const openvdb::Coord loose(0, 0, 1);
        inside.emplace_back(0, 0, 1);
        const LevelSet with = level_set_of(inside);
        const TriangleMesh truth = volume_to_mesh(with);
        inside.pop_back();
        const TriangleMesh without = volume_to_mesh(level_set_of(inside));
        const bool is_parted = mesh_topology(truth).components > mesh_topology(without).components;
        const LatticeTopology found = topology_of(without, with);
        const bool has_fault = std::any_of(found.faults.begin(), found.faults.end(), [&](const Vec3& f) {
            return (f - Vec3(loose.x(), loose.y(), loose.z())).norm() < 1e-9;
        });
        if (is_parted) {
            EXPECT_TRUE(has_fault) << "trial " << trial;
        }
        (is_parted ? parted : joined) += 1;
    }
    EXPECT_GT(parted, 10);
    EXPECT_GT(joined, 10);
}

/// V - E + F - C of the union of the closed unit cubes around these nodes.
int euler_of_cubes(const std::vector<openvdb::Coord>& nodes) {
    std::set<std::array<int, 3>> cells;  // of every dimension: each coordinate doubled, odd where it extends
    for (const openvdb::Coord& n : nodes)
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) cells.insert({2 * n.x() + x, 2 * n.y() + y, 2 * n.z() + z});
    int euler = 0;
    for (const auto& c : cells) {
        const int even = (c[0] % 2 == 0) + (c[1] % 2 == 0) + (c[2] % 2 == 0);
        euler += even % 2 == 0 ? 1 : -1;
    }
    return euler;
}

int count_26_components(std::vector<openvdb::Coord> nodes) {
    std::set<openvdb::Coord> left(nodes.begin(), nodes.end());
    int count = 0;
    while (!left.empty()) {
        ++count;
        std::vector<openvdb::Coord> front{*left.begin()};
        left.erase(left.begin());
        while (!front.empty()) {
            const openvdb::Coord at = front.back();
            front.pop_back();
            for (int i = 0; i < 27; ++i)
                if (const auto next = left.find(at.offsetBy(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1));
                    next != left.end()) {
                    front.push_back(*next);
                    left.erase(next);
                }
        }
    }
    return count;
}

TEST(LatticeTopology, HasNoFaultsOnlyWhereTheNodesHaveTheSameTopology) {
    // A floor and a ceiling, nodes apart between mesh and surface, that now and then touch or have a hole.
    std::mt19937 random(11);
    const auto below = [&](unsigned n) { return static_cast<int>(random() % n); };
    int same = 0, different = 0;
    for (int trial = 0; trial < 200; ++trial) {
        std::vector<openvdb::Coord> of_mesh, of_surface;
        const int slope = trial % 3, gap = 3 + trial % 2;
        for (int x = -4; x <= 4; ++x)
            for (int y = -4; y <= 4; ++y)
                for (auto* nodes : {&of_mesh, &of_surface}) {
                    const int floor = slope * x - 2 + below(2) + (below(40) == 0 ? 2 : 0);
                    const int top = below(150) == 0 ? -8 : std::min(floor, 7);
                    const int ceiling = std::max(slope * x + gap - below(2), top + 1);
                    for (int z = -7; z <= top; ++z) nodes->emplace_back(x, y, z);
                    for (int z = std::max(ceiling, -7); z <= 7; ++z) nodes->emplace_back(x, y, z);
                }
        const TriangleMesh mesh = volume_to_mesh(level_set_of(of_mesh));
        const bool passes = topology_of(mesh, level_set_of(of_surface)).faults.empty();
        (passes ? same : different) += 1;
        if (!passes) continue;
        EXPECT_EQ(count_26_components(of_mesh), count_26_components(of_surface)) << "trial " << trial;
        EXPECT_EQ(euler_of_cubes(of_mesh), euler_of_cubes(of_surface)) << "trial " << trial;
    }
    EXPECT_GT(same, 15);
    EXPECT_GT(different, 15);
}

/// Whether what a cube has in common with those of its neighbours, a part of its surface, is connected and
/// has no hole: then the cube changes no topology when it comes or goes.
bool meets_in_a_disc(std::uint32_t inside) {
    // Faces, edges and corners of the cube by their directions, as those of the neighbours.
    using Direction = std::array<int, 3>;
    const auto is_part = [](const Direction& part, const Direction& of) {
        for (int axis = 0; axis < 3; ++axis)
            if (of[axis] != 0 && part[axis] != of[axis]) return false;
        return true;
    };
    std::vector<Direction> all, common;
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z)
                if (x != 0 || y != 0 || z != 0) all.push_back({x, y, z});
    for (const Direction& part : all)
        if (std::any_of(all.begin(), all.end(), [&](const Direction& n) {
                return (inside >> bit_of(n[0], n[1], n[2]) & 1u) != 0 && is_part(part, n);
            }))
            common.push_back(part);
    int euler = 0;
    for (const Direction& part : common) euler += std::count(part.begin(), part.end(), 0) % 2 == 0 ? 1 : -1;
    if (common.empty() || euler != 1) return false;
    std::vector<Direction> connected = {common.back()}, left(common.begin(), common.end() - 1);
    for (std::size_t i = 0; i < connected.size(); ++i) {
        const Direction from = connected[i];
        const auto next = std::partition(left.begin(), left.end(), [&](const Direction& part) {
            return !is_part(part, from) && !is_part(from, part);
        });
        connected.insert(connected.end(), next, left.end());
        left.erase(next, left.end());
    }
    return left.empty();
}

TEST(LatticeNeighbours, AreSimpleWhereTheirCubesMeetInADisc) {
    std::mt19937 random(1);
    std::vector<std::uint32_t> neighbourhoods = {0u, (1u << 27) - 1};
    for (int i = 0; i < 20000; ++i) {
        std::bernoulli_distribution is_inside(0.1 + 0.8 * (i % 9) / 8.0);
        std::uint32_t inside = 0;
        for (int bit = 0; bit < 27; ++bit) inside |= static_cast<std::uint32_t>(is_inside(random)) << bit;
        neighbourhoods.push_back(inside);
    }
    int simple = 0;
    for (int again = 0; again < 2; ++again)  // what was found is kept
        for (const std::uint32_t inside : neighbourhoods) {
            ASSERT_EQ(is_simple(inside), meets_in_a_disc(inside)) << inside;
            simple += is_simple(inside);
        }
    EXPECT_GT(simple, 1000);
}

}  // namespace
}  // namespace isotrack
