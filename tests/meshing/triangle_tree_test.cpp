// Triangles near a place, against looking at all of them.
#include "meshing/triangle_tree.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "support/meshes.h"

namespace isotrack {
namespace {

class InTriangleTree : public ::testing::Test {
protected:
    /// A sphere of small triangles, and one as large as all.
    InTriangleTree() : mesh(support::icosphere(3)) {
        const int first = static_cast<int>(mesh.points.size());
        mesh.points.insert(mesh.points.end(), {Vec3(-3, -2, -1), Vec3(3, -1, 0), Vec3(0, 3, 2)});
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    double uniform(double from, double to) {
        return std::uniform_real_distribution<double>(from, to)(random);
    }
    Vec3 place() { return {uniform(-2, 2), uniform(-2, 2), uniform(-2, 2)}; }
    /// Returns how many triangles were looked at for each that was found.
    double expect_all_found(const TriangleTree& tree) {
        std::size_t found = 0, looked_at = 0;
        for (int round = 0; round < 200; ++round) {
            const Vec3 low = place();
            const Box box(low, low + Vec3(uniform(0, 0.6), uniform(0, 0.6), uniform(0, 0.6)));
            const std::vector<int> expected = support::triangles_meeting(box, mesh);
            EXPECT_EQ(tree.meeting(box), expected);
            found += expected.size();
            std::vector<int> near;
            tree.for_each_near(box, [&](int t) { near.push_back(t); });
            looked_at += near.size();
            std::sort(near.begin(), near.end());
            EXPECT_EQ(std::adjacent_find(near.begin(), near.end()), near.end());
            EXPECT_TRUE(std::includes(near.begin(), near.end(), expected.begin(), expected.end()));
        }
        EXPECT_GT(found, 100u);
        return static_cast<double>(looked_at) / static_cast<double>(found);
    }

    TriangleMesh mesh;
    std::mt19937 random{3};
};

TEST_F(InTriangleTree, ThoseThatMeetABoxAreFound) {
    EXPECT_LT(expect_all_found(TriangleTree(mesh.points, mesh.triangles)), 1.01);
}

TEST_F(InTriangleTree, TheyAreFoundWithoutAnotherOrder) {
    const TriangleMesh whole = mesh;
    for (const std::ptrdiff_t count : {1281, 1001, 1000}) {  // with a last run of one triangle, and of eight
        mesh.triangles.assign(whole.triangles.end() - count, whole.triangles.end());
        EXPECT_LT(expect_all_found(TriangleTree::in_order(mesh.points, mesh.triangles)), 20.0);
        std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
        expect_all_found(TriangleTree::in_order(mesh.points, mesh.triangles));
    }
}

TEST_F(InTriangleTree, TheyAreFoundAfterSomeWentAndOthersCame) {
    std::optional<TriangleTree> tree(std::in_place, mesh.points, mesh.triangles);
    for (int round = 0; round < 10; ++round) {
        std::vector<int> gone;
        std::vector<Triangle> left;
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
            if (uniform(0, 1) < 0.1)
                gone.push_back(static_cast<int>(t));
            else
                left.push_back(mesh.triangles[t]);
        mesh.triangles = left;
        // Vertices have other numbers now, and there are more or fewer triangles than before.
        const int coming = round % 2 == 0 ? 90 : 10;
        mesh.points.insert(mesh.points.begin(), 3, place());
        for (Triangle& t : mesh.triangles)
            for (int& v : t) v += 3;
        for (int k = 0; k < coming; ++k) {
            const int next = static_cast<int>(mesh.points.size());
            const Vec3 middle = place();
            for (int corner = 0; corner < 3; ++corner) mesh.points.push_back(middle + 0.1 * place());
            mesh.triangles.push_back({next, next + 1, next + 2});
        }
        tree.emplace(TriangleTree(mesh.points, mesh.triangles, *tree, gone));
        EXPECT_LT(expect_all_found(*tree), 1.01);
    }
    expect_all_found(TriangleTree(mesh.points, mesh.triangles, *tree, {}));
}

TEST(TriangleTree, FindsTheSameAtAnyNumberOfThreads) {
    const TriangleMesh mesh = support::icosphere(6);  // of many leaves
    const Box near(Vec3(-0.3, -0.2, -0.1), Vec3(1.3, 1.4, 1.5));
    std::vector<std::vector<int>> meeting;
    for (const std::size_t threads : {1, 4}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        tbb::task_arena(static_cast<int>(threads)).execute([&] {
            const TriangleTree tree(mesh.points, mesh.triangles);
            meeting.push_back(tree.meeting(near));
            meeting.push_back(TriangleTree(mesh.points, mesh.triangles, tree, {}).meeting(near));
            meeting.push_back(TriangleTree::in_order(mesh.points, mesh.triangles).meeting(near));
        });
    }
    EXPECT_GT(meeting.front().size(), 10000u);
    for (const std::vector<int>& found : meeting) EXPECT_EQ(found, support::triangles_meeting(near, mesh));
}

TEST_F(InTriangleTree, NothingIsFoundWhereAllWent) {
    const TriangleTree before(mesh.points, mesh.triangles);
    std::vector<int> all(mesh.triangles.size());
    std::iota(all.begin(), all.end(), 0);
    mesh.triangles.clear();
    const Box everywhere(Vec3::Constant(-9.0), Vec3::Constant(9.0));
    EXPECT_TRUE(TriangleTree(mesh.points, mesh.triangles, before, all).meeting(everywhere).empty());
    EXPECT_TRUE(TriangleTree(mesh.points, mesh.triangles).meeting(everywhere).empty());
    EXPECT_TRUE(TriangleTree::in_order(mesh.points, mesh.triangles).meeting(everywhere).empty());
}

}  // namespace
}  // namespace isotrack
