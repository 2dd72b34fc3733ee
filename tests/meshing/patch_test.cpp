#include "meshing/patch.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <string>

#include "isotrack/compare/baselines.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "meshing/triangle_distance.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

bool goes(const Patch& patch, std::size_t triangle) {
    return std::binary_search(patch.gone.begin(), patch.gone.end(), static_cast<int>(triangle));
}

TriangleMesh patched(const TriangleMesh& mesh, const Patch& patch) {
    TriangleMesh result;
    result.points = mesh.points;
    result.points.insert(result.points.end(), patch.points.begin(), patch.points.end());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        if (!goes(patch, t)) result.triangles.push_back(mesh.triangles[t]);
    result.triangles.insert(result.triangles.end(), patch.triangles.begin(), patch.triangles.end());
    return result;
}

void expect_sound(const TriangleMesh& mesh, std::size_t components, long euler) {
    const MeshTopology topology = mesh_topology(mesh);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_EQ(topology.components, components);
    EXPECT_EQ(topology.euler, euler);
    EXPECT_TRUE(self_intersections(mesh).empty());
}

std::optional<Patch> patch_around(const Vec3& place, double reach, const TriangleMesh& mesh,
                                  const TriangleMesh& fine, double spacing) {
    const TriangleTree tree(mesh.points, mesh.triangles);
    PatchSource source(fine, spacing);
    source.look_at(tree);
    return patch_for(triangles_around(place, reach, tree), tree, source);
}

TEST(PatchSource, LooksBesideForTheNearestThatFacesTheSameWay) {
    // A shell with large triangles outside and small ones inside, and places between.
    TriangleMesh shell = support::icosphere(2);
    const TriangleMesh inner = support::icosphere(5);
    constexpr double kInner = 0.9;
    const auto outer_count = static_cast<int>(shell.points.size());
    for (const Vec3& p : inner.points) shell.points.push_back(kInner * p);
    for (const auto& [i, j, k] : inner.triangles)
        shell.triangles.push_back({outer_count + i, outer_count + k, outer_count + j});
    const TriangleTree tree(shell.points, shell.triangles);
    struct Nearest {
        double same = std::numeric_limits<double>::infinity(), other = same;
    };
    const auto distance2 = [&](const Vec3& p, std::size_t t) {
        const auto& [i, j, k] = shell.triangles[t];
        return squared_distance(p, shell.points[i], shell.points[j], shell.points[k]);
    };
    const auto is_same = [&](const Vec3& way, std::size_t t) {
        return area_vector(shell.triangles[t], shell.points).dot(way) > 0.0;
    };
    int count[2] = {0, 0};
    for (const double radius : {0.92, 0.94, 1.02}) {
        TriangleMesh between = support::icosphere(3);
        for (Vec3& p : between.points) p *= radius;
        for (const double spacing : {0.1, 0.025, 0.002}) {
            PatchSource source(between, spacing);
            source.look_at(tree);
            std::vector<int> all(between.points.size());
            std::iota(all.begin(), all.end(), 0);
            source.look_beside(all);
            for (const int v : all) {
                const Vec3& p = between.points[v];
                Nearest nearest;
                for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
                    double& least = is_same(source.normal(v), t) ? nearest.same : nearest.other;
                    least = std::min(least, distance2(p, t));
                }
                ASSERT_GE(source.beside(v), 0);
                const auto beside = static_cast<std::size_t>(source.beside(v));
                const double near = 2.0 * spacing;
                const bool faces_the_same_way = nearest.same <= std::max(near * near, nearest.other);
                ASSERT_EQ(is_same(source.normal(v), beside), faces_the_same_way) << radius << ' ' << spacing;
                ASSERT_EQ(distance2(p, beside), faces_the_same_way ? nearest.same : nearest.other);
                ++count[faces_the_same_way];
            }
        }
    }
    EXPECT_GT(count[0], 100);
    EXPECT_GT(count[1], 100);
}

TEST(PatchSource, FindsTheSameInAnyOrderAndTheFirstOfEquals) {
    // At a vertex all triangles around are as near.
    const TriangleMesh sphere = support::icosphere(3);
    const TriangleTree tree(sphere.points, sphere.triangles);
    const TriangleTree in_order = TriangleTree::in_order(sphere.points, sphere.triangles);
    PatchSource at_once(sphere, 0.1), one_by_one(sphere, 0.1), in_other_tree(sphere, 0.1);
    for (PatchSource* source : {&at_once, &one_by_one}) source->look_at(tree);
    in_other_tree.look_at(in_order);
    std::vector<int> all(sphere.points.size());
    std::iota(all.begin(), all.end(), 0);
    at_once.look_beside(all);
    in_other_tree.look_beside(all);
    std::reverse(all.begin(), all.end());
    for (const int v : all) one_by_one.look_beside({v});
    for (const int v : all) {
        const auto first =
            std::find_if(sphere.triangles.begin(), sphere.triangles.end(),
                         [&](const Triangle& t) { return std::find(t.begin(), t.end(), v) != t.end(); });
        ASSERT_EQ(at_once.beside(v), first - sphere.triangles.begin());
        ASSERT_EQ(one_by_one.beside(v), at_once.beside(v));
        ASSERT_EQ(in_other_tree.beside(v), at_once.beside(v));
    }
}

TEST(PatchSource, LooksAtAnotherMesh) {
    const TriangleMesh none, sphere = support::icosphere(1);
    const TriangleTree no_tree(none.points, none.triangles), tree(sphere.points, sphere.triangles);
    PatchSource source(sphere, 0.1);
    source.look_at(no_tree);
    source.look_beside({0});
    EXPECT_EQ(source.beside(0), -1);
    source.look_at(tree);
    EXPECT_TRUE(source.looks_at(tree));
    EXPECT_FALSE(source.looks_at(no_tree));
    source.look_beside({0});
    EXPECT_GE(source.beside(0), 0);
}

TEST(Patch, BringsAFinerPartOfTheSameSphere) {
    const TriangleMesh sphere = support::icosphere(2), fine = support::icosphere(5);
    constexpr double kSpacing = 0.04;
    const double volume = enclosed_volume(sphere);
    for (const double reach : {0.05, 0.3, 0.8, 1.5})
        for (const Vec3& place : {Vec3(0, 0, 1), Vec3(0.6, -0.48, 0.64), Vec3(-0.9, 0.1, 0.3)}) {
            const auto patch = patch_around(place, reach, sphere, fine, kSpacing);
            ASSERT_TRUE(patch.has_value()) << reach;
            EXPECT_EQ(patch->euler, 0);
            for (std::size_t t = 0; t < sphere.triangles.size(); ++t) {
                const auto& [i, j, k] = sphere.triangles[t];
                const double d2 =
                    squared_distance(place, sphere.points[i], sphere.points[j], sphere.points[k]);
                EXPECT_TRUE(goes(*patch, t) || d2 > reach * reach);
            }
            const TriangleMesh result = patched(sphere, *patch);
            expect_sound(result, 1, 2);
            EXPECT_GT(enclosed_volume(result), volume);  // the finer sphere is the larger
            EXPECT_LT(enclosed_volume(result), enclosed_volume(fine));
        }
}

TEST(Patch, BringsAWholeComponentWhereAllOfItGoes) {
    const TriangleMesh ball = support::icosphere(1), fine = support::icosphere(3);
    const auto patch = patch_around({0, 0, 0}, 2.0, ball, fine, 0.2);
    ASSERT_TRUE(patch.has_value());
    EXPECT_EQ(patch->gone.size(), ball.triangles.size());
    expect_sound(patched(ball, *patch), 1, 2);
    EXPECT_EQ(patch->triangles.size(), fine.triangles.size());
}

TEST(Patch, IsNoneWhereTheOtherMeshIsElsewhere) {
    const TriangleMesh sphere = support::icosphere(2);
    EXPECT_FALSE(patch_around({0, 0, 1}, 0.3, sphere, support::icosphere(4, {9, 0, 0}), 0.1));
    EXPECT_FALSE(patch_around({0, 0, 5}, 0.3, sphere, support::icosphere(4), 0.1));
}

/// Of a level set at voxels of 1.
template <typename Distance>
TriangleMesh mesh_of(const Eigen::Vector3i& extent, const Distance& distance) {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -extent.x(); x <= extent.x(); ++x)
        for (int y = -extent.y(); y <= extent.y(); ++y)
            for (int z = -extent.z(); z <= extent.z(); ++z) {
                const double d = distance(Vec3(x, y, z));
                if (std::abs(d) < 3.0)
                    values.setValue({x, y, z}, static_cast<float>(d));
                else if (d < 0.0)
                    values.setValueOff({x, y, z}, -3.0f);
            }
    return volume_to_mesh(LevelSet(grid));
}

/// Two balls, and a bar between them where `joined`.
TriangleMesh two_balls(bool joined) {
    return mesh_of({24, 12, 12}, [&](const Vec3& p) {
        const double d = std::min((p - Vec3(11.6, 0.1, 0.3)).norm(), (p + Vec3(11.3, 0.2, 0.1)).norm()) - 9.2;
        const double bar = std::max(std::hypot(p.y() - 0.1, p.z() + 0.2) - 1.4, std::abs(p.x()) - 11.0);
        return joined ? std::min(d, bar) : d;
    });
}

TEST(Patch, BringsTheOtherMeshsTopology) {
    const TriangleMesh apart = two_balls(false), joined = two_balls(true);
    ASSERT_EQ(mesh_topology(apart).components, 2u);
    ASSERT_EQ(mesh_topology(joined).components, 1u);
    const auto join = patch_around({0, 0, 0}, 5.0, apart, joined, 1.0);
    ASSERT_TRUE(join.has_value());
    EXPECT_EQ(join->euler, -2);
    expect_sound(patched(apart, *join), 1, 2);
    const auto part = patch_around({0, 0, 0}, 5.0, joined, apart, 1.0);
    ASSERT_TRUE(part.has_value());
    EXPECT_EQ(part->euler, 2);
    expect_sound(patched(joined, *part), 2, 4);
}

/// A cube of half edge 12, turned.
TriangleMesh fine_cube(const Mat3& turn) {
    return mesh_of({24, 24, 24}, [&](const Vec3& p) {
        const Vec3 beyond = (turn.transpose() * p).cwiseAbs() - Vec3::Constant(12.0);
        return beyond.cwiseMax(0.0).norm() + std::min(0.0, beyond.maxCoeff());
    });
}

/// The same with triangles 6 large.
TriangleMesh coarse_cube(const Mat3& turn) {
    constexpr int kCells = 4;
    std::map<std::array<int, 3>, int> number;
    TriangleMesh mesh;
    const auto vertex = [&](std::array<int, 3> at) {
        const auto [entry, is_new] = number.try_emplace(at, static_cast<int>(mesh.points.size()));
        if (is_new) mesh.points.push_back(turn * (Vec3(at[0], at[1], at[2]) * 6.0 - Vec3::Constant(12.0)));
        return entry->second;
    };
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {0, kCells})
            for (int u = 0; u < kCells; ++u)
                for (int v = 0; v < kCells; ++v) {
                    const auto at = [&](int du, int dv) {
                        std::array<int, 3> node{};
                        node[axis] = side;
                        node[(axis + 1) % 3] = u + (side > 0 ? du : dv);
                        node[(axis + 2) % 3] = v + (side > 0 ? dv : du);
                        return vertex(node);
                    };
                    mesh.triangles.push_back({at(0, 0), at(1, 0), at(1, 1)});
                    mesh.triangles.push_back({at(0, 0), at(1, 1), at(0, 1)});
                }
    return mesh;
}

TEST(Patch, PartsHaveTheSameNumbersWhereTheyAreAlikeButForTheirTriangles) {
    const TriangleMesh sphere = support::icosphere(3), fine = support::icosphere(4);
    const TriangleTree tree(sphere.points, sphere.triangles), tree_of_fine(fine.points, fine.triangles);
    const auto around = [](const std::vector<Vec3>& places, double reach, const TriangleTree& mesh) {
        std::vector<int> some;
        for (const Vec3& place : places)
            for (const int t : triangles_around(place, reach, mesh)) some.push_back(t);
        std::sort(some.begin(), some.end());
        return some;
    };
    const auto without = [](const std::vector<int>& all, const std::vector<int>& some) {
        std::vector<int> rest;
        std::set_difference(all.begin(), all.end(), some.begin(), some.end(), std::back_inserter(rest));
        return rest;
    };
    const Vec3 up(0, 0, 1), down(0, 0, -1);
    struct Part {
        std::string name;
        std::vector<int> coarse, other;  // triangles of either mesh
    };
    const auto part = [&](const std::string& name, const auto& of) {
        return Part{name, of(tree), of(tree_of_fine)};
    };
    const std::vector<Part> parts = {
        part("nothing", [&](const TriangleTree&) { return std::vector<int>(); }),
        part("a disc", [&](const TriangleTree& m) { return around({up}, 0.7, m); }),
        part("two discs",
             [&](const TriangleTree& m) {
                 return around({up, down}, 0.7, m);
             }),
        part("a ring",
             [&](const TriangleTree& m) { return without(around({up}, 1.0, m), around({up}, 0.4, m)); }),
        part("a ring and a disc",
             [&](const TriangleTree& m) {
                 return without(around({up, down}, 1.0, m), around({up}, 0.4, m));
             }),
        part("a sphere", [&](const TriangleTree& m) { return around({up}, 3.0, m); })};
    for (const Part& one : parts)
        for (const Part& other : parts)
            EXPECT_EQ(have_same_numbers(one.coarse, tree, other.other, tree_of_fine), &one == &other)
                << one.name << ", " << other.name;
    // A torus has as many components and loops as a sphere, components and the Euler number of a ring, and
    // loops and the Euler number of nothing.
    const TriangleMesh torus = support::torus(20, 12), fine_torus = support::torus(40, 24);
    const TriangleTree tree_of_torus(torus.points, torus.triangles),
        tree_of_fine_torus(fine_torus.points, fine_torus.triangles);
    const auto all = around({up}, 9.0, tree_of_torus);
    ASSERT_EQ(all.size(), torus.triangles.size());
    EXPECT_TRUE(
        have_same_numbers(all, tree_of_torus, around({up}, 9.0, tree_of_fine_torus), tree_of_fine_torus));
    for (const Part& other : parts)
        EXPECT_FALSE(have_same_numbers(all, tree_of_torus, other.other, tree_of_fine)) << other.name;
}

TEST(Patch, LeavesAManifoldWhereItsFansClose) {
    const TriangleMesh sphere = support::icosphere(2);
    const TriangleTree tree(sphere.points, sphere.triangles);
    Patch same;
    same.gone = triangles_around({0, 0, 1}, 0.4, tree);
    for (const int t : same.gone) same.triangles.push_back(sphere.triangles[t]);
    ASSERT_GT(same.triangles.size(), 4u);
    EXPECT_TRUE(stays_manifold(same, tree));
    const auto is_sound = [&](const Patch& patch) {
        const MeshTopology topology = mesh_topology(patched(sphere, patch));
        return topology.closed() && topology.oriented() && topology.manifold();
    };
    const auto expect_no_manifold = [&](const Patch& patch) {
        EXPECT_FALSE(stays_manifold(patch, tree));
        EXPECT_FALSE(is_sound(patch));  // by an independent count
    };
    Patch open = same;
    open.triangles.pop_back();
    expect_no_manifold(open);
    Patch nothing = same;
    nothing.triangles.clear();
    expect_no_manifold(nothing);
    Patch all_goes = nothing;
    all_goes.gone.resize(sphere.triangles.size());
    std::iota(all_goes.gone.begin(), all_goes.gone.end(), 0);
    EXPECT_TRUE(stays_manifold(all_goes, tree));
    Patch turned = same;
    std::swap(turned.triangles[0][1], turned.triangles[0][2]);
    expect_no_manifold(turned);
    Patch twice = same;
    twice.triangles.push_back(twice.triangles[0]);
    expect_no_manifold(twice);
    // A tetrahedron that has one vertex in common with the rest, far from what goes.
    Patch pinched = same;
    const int first = static_cast<int>(sphere.points.size());
    const int far =
        static_cast<int>(std::min_element(sphere.points.begin(), sphere.points.end(),
                                          [](const Vec3& a, const Vec3& b) { return a.z() < b.z(); }) -
                         sphere.points.begin());
    pinched.points = {{0, 0, -2}, {1, 0, -2}, {0, 1, -2}};
    for (const Triangle& t : {Triangle{first, first + 1, first + 2}, Triangle{first, far, first + 1},
                              Triangle{first + 1, far, first + 2}, Triangle{first + 2, far, first}})
        pinched.triangles.push_back(t);
    expect_no_manifold(pinched);
    Patch apart = pinched;  // with vertices of its own
    apart.points.push_back({0, 0, -3});
    for (std::size_t t = same.triangles.size(); t < apart.triangles.size(); ++t)
        std::replace(apart.triangles[t].begin(), apart.triangles[t].end(), far, first + 3);
    EXPECT_TRUE(stays_manifold(apart, tree));
    EXPECT_TRUE(is_sound(apart));
}

TEST(Patch, CrossesNothingAmongLargeTriangles) {
    const Mat3 turn = Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()).toRotationMatrix();
    const TriangleMesh fine = fine_cube(turn), coarse = coarse_cube(turn);
    expect_sound(coarse, 1, 2);
    for (const double reach : {1.0, 2.0, 3.5, 5.0})
        for (const Vec3& place : {Vec3(12, 1, 2), Vec3(12, 12, 3), Vec3(-12, 12, 0.5), Vec3(12, 12, 12),
                                  Vec3(3, -12, 12), Vec3(-12, -12, 12), Vec3(-4, -5, -12)}) {
            const auto patch = patch_around(turn * place, reach, coarse, fine, 1.0);
            ASSERT_TRUE(patch.has_value()) << reach << ", " << place.transpose();
            EXPECT_EQ(patch->euler, 0);
            expect_sound(patched(coarse, *patch), 1, 2);
        }
}

}  // namespace
}  // namespace isotrack
