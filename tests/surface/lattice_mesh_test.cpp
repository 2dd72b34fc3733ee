#include "surface/lattice_mesh.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "disjoint_sets.h"
#include "isotrack/compare/baselines.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "meshing/triangle_distance.h"
#include "surface/ambiguous_faces.h"
#include "surface/float_precision.h"

namespace isotrack {
namespace {

constexpr int kHalf = 10;

/// Values of a function at the nodes of a cube, outside around it.
template <typename Value>
LevelSet cube_of(const Value& value, const Vec3& voxel = Vec3::Ones(), int half = kHalf) {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    openvdb::Mat4d to_world = openvdb::Mat4d::identity();
    for (int k = 0; k < 3; ++k) to_world[k][k] = voxel[k];
    grid->setTransform(openvdb::math::Transform::createLinearTransform(to_world));
    auto values = grid->getAccessor();
    for (int x = -half; x <= half; ++x)
        for (int y = -half; y <= half; ++y)
            for (int z = -half; z <= half; ++z) {
                const bool border = std::max({std::abs(x), std::abs(y), std::abs(z)}) == half;
                values.setValue({x, y, z},
                                border ? 3.0f : static_cast<float>(std::clamp(value(x, y, z), -3.0, 3.0)));
            }
    return LevelSet(grid);
}

/// Inside nodes strewn at random: faces of all kinds, crumbs, tunnels.
LevelSet strewn(unsigned seed, double share, int half = kHalf) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    return cube_of(
        [&](int, int, int) {
            const double size = 0.02 + 0.96 * uniform(random);
            return uniform(random) < share ? -size : size;
        },
        Vec3::Ones(), half);
}

const std::vector<Vec3> kAll = {Vec3::Zero()};
constexpr double kFarReach = 1000.0;

void expect_as_volume_to_mesh(const LevelSet& level_set) {
    const TriangleMesh mesh = level_set.lattice_mesh(kAll, kFarReach);
    const MeshTopology ours = mesh_topology(mesh), theirs = mesh_topology(volume_to_mesh(level_set));
    EXPECT_TRUE(ours.closed() && ours.oriented());
    EXPECT_EQ(ours.components, theirs.components);
    EXPECT_EQ(ours.euler, theirs.euler);
    EXPECT_EQ(level_set.lattice_euler(), theirs.euler);
    EXPECT_EQ(level_set.lattice_component_count(), theirs.components);
    const auto components = level_set.lattice_components();
    ASSERT_TRUE(components.has_value());
    EXPECT_EQ(components->size(), theirs.components);
}

using Place = std::array<double, 3>;
std::set<Place> places_of(const std::vector<Vec3>& points) {
    std::set<Place> result;
    for (const Vec3& p : points) result.insert({p.x(), p.y(), p.z()});
    return result;
}

/// Every crossing is a vertex.
void expect_crossings(const LevelSet& level_set) {
    const std::set<Place> vertices = places_of(level_set.lattice_mesh(kAll, kFarReach).points);
    for (const auto& crossing : level_set.crossings()) {
        const Vec3 p = to_float_precision(crossing.point);
        const double h = 1e-5;  // both are rounded
        const auto near = vertices.lower_bound({p.x() - h, -1e9, -1e9});
        EXPECT_TRUE(std::any_of(near, vertices.upper_bound({p.x() + h, 1e9, 1e9}),
                                [&](const Place& v) { return (Vec3(v[0], v[1], v[2]) - p).norm() < h; }));
    }
}

/// Every triangle stays within a cell.
void expect_within_cells(const LevelSet& level_set) {
    const TriangleMesh mesh = level_set.lattice_mesh(kAll, kFarReach);
    const Eigen::Affine3d to_lattice = level_set.lattice().inverse();
    for (const Triangle& t : mesh.triangles) {
        Box box;
        for (const int v : t) box.extend(Vec3(to_lattice * mesh.points[v]));
        const Vec3 cell = box.center().array().floor();
        constexpr double kRounded = 1e-5;
        EXPECT_TRUE(((box.min() - cell).array() > -kRounded).all() &&
                    ((box.max() - cell).array() < 1.0 + kRounded).all());
    }
}

TEST(LatticeMesh, HasTheEulerNumberThatItsCellsSay) {
    // Single voxels in leaves far apart, next to one another, and with corners alone in common.
    for (const unsigned seed : {1u, 2u, 3u, 4u, 5u, 6u}) {
        std::mt19937 random(seed);
        const auto coordinate = [&] { return static_cast<int>(random() % 40) - 20; };
        auto grid = openvdb::FloatGrid::create(1.0f);
        grid->setGridClass(openvdb::GRID_LEVEL_SET);
        auto values = grid->getAccessor();
        const int count = seed % 2 == 0 ? 300 : 6000;
        for (int i = 0; i < count; ++i) {
            const openvdb::Coord node(coordinate(), coordinate(), coordinate());
            const float size = 0.02f + 0.9f * static_cast<float>(random() % 1000) / 1000.0f;
            values.setValue(node, random() % 3 > 0 ? -size : size);
        }
        const LevelSet scattered(grid);
        const MeshTopology theirs = mesh_topology(volume_to_mesh(scattered));
        EXPECT_EQ(scattered.lattice_euler(), theirs.euler) << seed;
        EXPECT_EQ(scattered.lattice_component_count(), theirs.components) << seed;
    }
}

TEST(LatticeMesh, HasTheComponentsThatHangTogetherAlongTheBorderOfItsLeaves) {
    // A full block with pits in one of its sides: their walls meet the rest at that side alone, beyond which
    // there is a tile.
    for (int side = 0; side < 6; ++side) {
        auto grid = openvdb::FloatGrid::create(1.0f);
        grid->setGridClass(openvdb::GRID_LEVEL_SET);
        auto values = grid->getAccessor();
        for (auto node = openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(15)).begin(); node; ++node) {
            const int axis = side / 2, depth = side % 2 == 0 ? (*node)[axis] : 15 - (*node)[axis],
                      u = (*node)[(axis + 1) % 3], w = (*node)[(axis + 2) % 3];
            const auto is_within = [](int i, int low) { return i >= low && i < low + 3; };
            const bool in_pit = depth < 4 && is_within(w, 6) && (is_within(u, 2) || is_within(u, 9));
            values.setValue(*node, in_pit ? 0.5f : -0.5f);
        }
        const LevelSet block(grid);
        const MeshTopology theirs = mesh_topology(volume_to_mesh(block));
        EXPECT_EQ(theirs.components, 1u);
        EXPECT_EQ(block.lattice_component_count(), theirs.components) << side;
        EXPECT_EQ(block.lattice_euler(), theirs.euler) << side;
    }
}

/// Of full leaves and tiles, by their places in leaves; outside elsewhere.
openvdb::FloatGrid::Ptr blocks(const std::vector<openvdb::Coord>& inside_leaves,
                               const std::vector<openvdb::Coord>& inside_tiles) {
    auto grid = openvdb::FloatGrid::create(1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    constexpr int kLeaf = 8;
    for (const openvdb::Coord& tile : inside_tiles)
        grid->tree().addTile(1, openvdb::Coord(kLeaf * tile.x(), kLeaf * tile.y(), kLeaf * tile.z()), -1.0f,
                             false);
    for (const openvdb::Coord& leaf : inside_leaves)
        grid->tree()
            .touchLeaf(openvdb::Coord(kLeaf * leaf.x(), kLeaf * leaf.y(), kLeaf * leaf.z()))
            ->fill(-0.5f, true);
    return grid;
}

TEST(LatticeMesh, HasNoComponentsBetweenTiles) {
    // All edges of an inside tile but those next to the leaf are between tiles.
    const LevelSet beside(blocks({{1, 1, 0}}, {{0, 0, 0}}));
    EXPECT_EQ(beside.lattice_component_count(), 1u);
}

TEST(LatticeMesh, HasComponentsThatHangTogetherInFacesThatBeginInATile) {
    // A cavity around the upper corner of a leaf, of seven tiles: its walls meet at edges that begin in the
    // three blocks below that leaf, which are leaves or tiles.
    std::vector<openvdb::Coord> others, below{{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-1), openvdb::Coord(2)).begin(); c; ++c) {
        const bool in_cavity =
            openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(1)).isInside(*c) && *c != openvdb::Coord(0);
        if (!in_cavity && std::find(below.begin(), below.end(), *c) == below.end()) others.push_back(*c);
    }
    EXPECT_EQ(LevelSet(blocks(others, below)).lattice_component_count(), 2u);
    others.insert(others.end(), below.begin(), below.end());
    EXPECT_EQ(LevelSet(blocks(others, {})).lattice_component_count(), 2u);
}

/// The crossed edges that have an end in a leaf, joined face by face; all are within `kSide` nodes.
std::size_t components_face_by_face(const openvdb::FloatTree& tree) {
    constexpr int kLow = -2, kSide = 28;
    const auto inside = [&](const openvdb::Coord& c) { return tree.getValue(c) < 0.0f; };
    const auto step = [](const openvdb::Coord& c, int axis, int by = 1) {
        openvdb::Coord result = c;
        result[axis] += by;
        return result;
    };
    const auto is_seen = [&](const openvdb::Coord& c, int axis) {
        const openvdb::Coord to = step(c, axis);
        return inside(c) != inside(to) && (tree.probeConstLeaf(c) || tree.probeConstLeaf(to));
    };
    const auto number = [](const openvdb::Coord& c, int axis) {
        return (((c.x() - kLow) * kSide + c.y() - kLow) * kSide + c.z() - kLow) * 3 + axis;
    };
    DisjointSets edges(static_cast<std::size_t>(kSide) * kSide * kSide * 3);
    std::size_t components = 0;
    for (auto c = openvdb::CoordBBox(openvdb::Coord(kLow), openvdb::Coord(kLow + kSide - 2)).begin(); c;
         ++c) {
        for (int axis = 0; axis < 3; ++axis) components += is_seen(*c, axis);
        for (int u = 0; u < 3; ++u)
            for (int w = u + 1; w < 3; ++w) {
                using Edge = std::pair<openvdb::Coord, int>;
                const auto join = [&](const Edge& a, const Edge& b) {
                    if (is_seen(a.first, a.second) && is_seen(b.first, b.second))
                        components -= edges.join(number(a.first, a.second), number(b.first, b.second));
                };
                const Edge around[] = {{*c, u}, {step(*c, u), w}, {step(*c, w), u}, {*c, w}};
                std::vector<Edge> crossed;
                for (const Edge& edge : around)
                    if (inside(edge.first) != inside(step(edge.first, edge.second))) crossed.push_back(edge);
                if (crossed.size() == 2) join(crossed[0], crossed[1]);
                if (crossed.size() < 4) continue;
                const bool low = inside(*c),
                           joined = joins_diagonal([&](int side, int a, int b) {
                               const openvdb::Coord corner = step(step(*c, u, low ? a : 1 - a), w, b);
                               return inside(step(corner, 3 - u - w, side == 0 ? -1 : 1));
                           });
                const bool cuts_off_low = low != joined;  // and the one across
                join(around[0], around[cuts_off_low ? 3 : 1]);
                join(around[2], around[cuts_off_low ? 1 : 3]);
            }
    }
    return components;
}

TEST(LatticeMesh, HasTheComponentsOfLeavesAndTilesInAnyOrder) {
    std::mt19937 random(11);
    std::size_t most = 0;
    for (int round = 0; round < 60; ++round) {
        std::vector<openvdb::Coord> leaves, tiles;
        for (auto c = openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(2)).begin(); c; ++c)
            switch (random() % 4) {
                case 0:
                    tiles.push_back(*c);
                    break;
                case 1:
                    leaves.push_back(*c);
                    break;
                default:
                    break;
            }
        const openvdb::FloatGrid::Ptr grid = blocks(leaves, tiles);
        auto values = grid->getAccessor();
        for (int i = 0; i < 40 * (round % 3); ++i) {  // which makes leaves of tiles
            const auto coordinate = [&] { return static_cast<int>(random() % 24); };
            const openvdb::Coord node(coordinate(), coordinate(), coordinate() / 8);
            values.setValue(node, random() % 2 == 0 ? -0.5f : 0.5f);
        }
        const std::size_t expected = components_face_by_face(grid->tree());
        EXPECT_EQ(LevelSet(grid).lattice_component_count(), expected) << round;
        most = std::max(most, expected);
    }
    EXPECT_GT(most, 10u);
}

TEST(LatticeMesh, OfABallIsOnIt) {
    const Vec3 centre(0.3, -0.2, 0.1);
    const LevelSet ball = cube_of([&](int x, int y, int z) { return (Vec3(x, y, z) - centre).norm() - 7.3; });
    expect_as_volume_to_mesh(ball);
    expect_within_cells(ball);
    const TriangleMesh mesh = ball.lattice_mesh(kAll, kFarReach);
    double farthest = 0.0, sum = 0.0;
    for (const Vec3& p : mesh.points) {
        farthest = std::max(farthest, std::abs((p - centre).norm() - 7.3));
        sum += std::abs((p - centre).norm() - 7.3);
    }
    EXPECT_LT(farthest, 0.05);  // what interpolation and the chords of faces leave
    EXPECT_LT(sum / static_cast<double>(mesh.points.size()), 0.02);
    const double pi = std::acos(-1.0), area = 4.0 * pi * 7.3 * 7.3;
    EXPECT_NEAR(enclosed_volume(mesh), area * 7.3 / 3.0, 0.03 * area);
}

TEST(LatticeMesh, HasTheTopologyOfVolumeToMeshWhateverTheNodesAre) {
    for (const double share : {0.05, 0.3, 0.5, 0.8})
        for (unsigned seed = 0; seed < 5; ++seed) {
            const LevelSet level_set = strewn(seed, share);
            expect_as_volume_to_mesh(level_set);
            expect_crossings(level_set);
            expect_within_cells(level_set);
            EXPECT_TRUE(self_intersections(level_set.lattice_mesh(kAll, kFarReach)).empty());
        }
}

/// With few triangles it has the same topology, crosses nothing, and is near every crossing.
void expect_light(const LevelSet& level_set, double close, double most_triangles) {
    const TriangleMesh mesh = level_set.light_lattice_mesh(close);
    const MeshTopology topology = mesh_topology(mesh), wanted = mesh_topology(volume_to_mesh(level_set));
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_EQ(topology.components, wanted.components);
    EXPECT_EQ(topology.euler, wanted.euler);
    EXPECT_TRUE(self_intersections(mesh).empty());
    EXPECT_EQ(places_of(mesh.points).size(), mesh.points.size());
    const auto crossings = level_set.crossings();
    EXPECT_LE(static_cast<double>(mesh.triangles.size()),
              most_triangles * static_cast<double>(crossings.size()));
    double farthest = 0.0;
    for (std::size_t c = 0; c < crossings.size(); c += 7) {  // each is compared with all triangles
        double nearest = 1e9;
        for (const auto& [i, j, k] : mesh.triangles)
            nearest = std::min(nearest, squared_distance(crossings[c].point, mesh.points[i], mesh.points[j],
                                                         mesh.points[k]));
        farthest = std::max(farthest, std::sqrt(nearest));
    }
    EXPECT_LT(farthest, close + 1e-5);  // rounded
}

TEST(LatticeMesh, IsLightWithinADistanceOfTheCrossings) {
    const LevelSet ball = cube_of([](int x, int y, int z) { return Vec3(x, y, z).norm() - 7.3; });
    expect_light(ball, 0.5, 2.0);
    for (const double share : {0.05, 0.3, 0.5, 0.8})
        for (unsigned seed = 0; seed < 2; ++seed) {
            expect_light(strewn(seed, share), 0.5, 4.0);
            expect_light(strewn(seed, share), 0.05, 6.0);
        }
}

/// Triangles have an area, and no two vertices are in one place.
TEST(LatticeMesh, IsSoundWhereNodesAreOnTheSurface) {
    int count = 0;  // of light meshes
    for (const Vec3& voxel : {Vec3(1, 1, 1), Vec3(0.01, 0.01, 0.01)})
        for (unsigned seed = 0; seed < 4; ++seed) {
            std::mt19937 random(seed);
            std::uniform_int_distribution<int> any(-2, 3);
            const LevelSet level_set = cube_of(
                [&](int, int, int) {
                    constexpr double kValues[] = {-0.7, -1e-9, -0.0, 0.0, 1e-9, 0.7};
                    return kValues[any(random) + 2] * voxel.x();
                },
                voxel);
            const MeshTopology theirs = mesh_topology(volume_to_mesh(level_set));
            const auto expect_sound = [&](const TriangleMesh& mesh) {
                const MeshTopology ours = mesh_topology(mesh);
                EXPECT_TRUE(ours.closed() && ours.oriented());
                EXPECT_EQ(ours.components, theirs.components);
                EXPECT_EQ(ours.euler, theirs.euler);
                EXPECT_EQ(places_of(mesh.points).size(), mesh.points.size());
                const std::vector<double> angles = smallest_angles(mesh);
                EXPECT_GT(*std::min_element(angles.begin(), angles.end()), 0.001);
            };
            const TriangleMesh mesh = level_set.lattice_mesh(kAll, kFarReach),
                               light = level_set.light_lattice_mesh(0.5 * voxel.x());
            expect_sound(mesh);
            if (light.empty()) {
                EXPECT_FALSE(self_intersections(mesh).empty());
                continue;
            }
            expect_sound(light);
            EXPECT_TRUE(self_intersections(light).empty());
            ++count;
        }
    EXPECT_GT(count, 0);
}

TEST(LatticeMesh, FacesOutwardInMirroredAndStretchedLattices) {
    const auto ball = [](int x, int y, int z) { return Vec3(x, y, z).norm() - 6.2; };
    for (const Vec3& voxel : {Vec3(0.5, 0.5, 0.5), Vec3(-1, 1, 1), Vec3(1, 2, 0.7), Vec3(-1, -2, -1)}) {
        const LevelSet level_set = cube_of(ball, voxel);
        expect_as_volume_to_mesh(level_set);
        EXPECT_GT(enclosed_volume(level_set.lattice_mesh(kAll, kFarReach)), 0.0);
    }
}

void expect_part_of_the_whole(const LevelSet& level_set, const std::vector<Vec3>& places, double reach) {
    const auto triangles_in = [&](const TriangleMesh& mesh) {
        std::multiset<std::array<double, 9>> result;
        for (const Triangle& t : mesh.triangles) {
            std::array<double, 9> place;
            bool in = false;
            for (int k = 0; k < 3; ++k)
                for (int c = 0; c < 3; ++c) place[3 * k + c] = mesh.points[t[k]][c];
            for (const Vec3& p : places)
                in = in || (Vec3(place[0], place[1], place[2]) - p).lpNorm<Eigen::Infinity>() < 0.6 * reach;
            if (in) result.insert(place);
        }
        return result;
    };
    const TriangleMesh part = level_set.lattice_mesh(places, reach),
                       all = level_set.lattice_mesh(kAll, kFarReach);
    EXPECT_EQ(triangles_in(part), triangles_in(all));
    // Now that the whole is known a part is taken from it.
    EXPECT_EQ(triangles_in(level_set.lattice_mesh(places, reach)), triangles_in(all));
    EXPECT_FALSE(triangles_in(part).empty());
    EXPECT_LT(part.triangles.size(), all.triangles.size() / 4);
    EXPECT_TRUE(level_set.lattice_mesh({}, reach).empty());
}

TEST(LatticeMesh, OfSomePlacesIsAPartOfTheWhole) {
    const std::vector<Vec3> places = {Vec3(-4, 2, 1), Vec3(5, 5, -6)};
    expect_part_of_the_whole(strewn(3, 0.4), places, 3.0);
    expect_part_of_the_whole(strewn(3, 0.4), places, 2.0);
    // Of so large a grid a part is taken: see `part_around`.
    for (const double share : {0.1, 0.4, 0.7})
        expect_part_of_the_whole(strewn(3, share, 30), {Vec3(-4, 2, 1), Vec3(11, 17, -14)}, 6.0);
    // Inside and out, where the nodes far away are not as those around.
    const auto ball = [](int x, int y, int z) { return Vec3(x, y, z).norm() - 8.3; };
    for (const Vec3& voxel : {Vec3(1, 1, 1), Vec3(-1, 1.5, 0.8)}) {
        const Vec3 top = Vec3(4.1, 4.8, 5.3).cwiseProduct(voxel);
        expect_part_of_the_whole(cube_of(ball, voxel), {top}, 2.0);
    }
}

TEST(LatticeMesh, OfAPartOfALargeGridIsAPartOfTheWhole) {
    const float voxel = 0.5f;
    const openvdb::Vec3f centre(0.1f, -0.2f, 0.3f);
    const LevelSet ball(openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(20.0f, centre, voxel));
    expect_part_of_the_whole(ball, {Vec3(20.1, -0.2, 0.3), Vec3(0.1, -0.2, -19.7)}, 3.0);
}

TEST(LatticeComponents, AreWhereTheirCrossingsAre) {
    // Balls in a lattice that is turned and stretched.
    struct Ball {
        Vec3 centre;
        double radius;
    };
    const std::vector<Ball> balls = {{{-6, -6, 0}, 5.0}, {{5, 4, 3}, 3.3}, {{4, -4, -5}, 0.9}};
    const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
    const Mat3 to_world = turn * Vec3(0.25, 0.3, 0.2).asDiagonal();
    openvdb::Mat4d transform = openvdb::Mat4d::identity();
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) transform[row][column] = to_world(column, row);
    auto grid = openvdb::FloatGrid::create(1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(transform));
    auto values = grid->getAccessor();
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-75), openvdb::Coord(75)).begin(); c; ++c) {
        const Vec3 p = to_world * Vec3((*c).x(), (*c).y(), (*c).z());
        double distance = 1.0;
        for (const Ball& ball : balls) distance = std::min(distance, (p - ball.centre).norm() - ball.radius);
        if (std::abs(distance) < 1.0)
            values.setValue(*c, static_cast<float>(distance));
        else if (distance < 0.0)
            values.setValueOff(*c, -1.0f);
    }
    const LevelSet level_set(grid);
    const auto boxes = level_set.lattice_components();
    ASSERT_TRUE(boxes.has_value());
    ASSERT_EQ(boxes->size(), balls.size());
    for (std::size_t b = 1; b < boxes->size(); ++b)
        EXPECT_LT((*boxes)[b - 1].min().x(), (*boxes)[b].min().x());
    for (const std::size_t threads : {1, 4}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        const auto again = tbb::task_arena(static_cast<int>(threads)).execute([&] {
            return level_set.lattice_components();
        });
        for (std::size_t b = 0; b < boxes->size(); ++b) {
            EXPECT_EQ((*again)[b].min(), (*boxes)[b].min());
            EXPECT_EQ((*again)[b].max(), (*boxes)[b].max());
        }
    }
    std::vector<Box> expected(balls.size());
    for (const auto& crossing : level_set.crossings()) {
        const auto nearest = std::min_element(balls.begin(), balls.end(), [&](const Ball& a, const Ball& b) {
            const auto off = [&](const Ball& ball) {
                return (crossing.point - ball.centre).norm() - ball.radius;
            };
            return off(a) < off(b);
        });
        expected[nearest - balls.begin()].extend(crossing.point);
    }
    for (std::size_t b = 0; b < balls.size(); ++b) {
        const auto found = std::find_if(boxes->begin(), boxes->end(),
                                        [&](const Box& box) { return box.contains(balls[b].centre); });
        ASSERT_NE(found, boxes->end()) << b;
        EXPECT_LT((found->min() - expected[b].min()).norm(), 1e-6) << b;
        EXPECT_LT((found->max() - expected[b].max()).norm(), 1e-6) << b;
        EXPECT_NEAR(found->sizes().maxCoeff(), 2.0 * balls[b].radius, 0.1) << b;
    }
}

}  // namespace
}  // namespace isotrack
