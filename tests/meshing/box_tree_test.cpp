// Boxes that meet, against looking at all of them.
#include "meshing/box_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <utility>

#include "meshing/triangle_box.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

/// Triangles of all sizes: small ones everywhere, some as large as all, flat ones, many in the same place,
/// and a heap of them far away.
TriangleMesh strewn(int count) {
    std::mt19937 random(count);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto place = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
    TriangleMesh mesh;
    for (int t = 0; t < count; ++t) {
        const double size = t % 20 == 0 ? 1.0 : 0.1;
        Vec3 middle = t % 7 == 0 ? Vec3(Vec3::Constant(0.25)) : place();
        if (t % 11 == 0) middle = Vec3::Constant(500.0) + 1e-3 * place();
        for (int k = 0; k < 3; ++k) {
            Vec3 corner = middle + size * place();
            if (t % 13 == 0) corner.z() = 0.5;
            mesh.points.push_back(corner);
        }
        mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    return mesh;
}

/// How often each pair is found.
std::map<std::pair<int, int>, int> pairs_in(const BoxTree& tree) {
    std::map<std::pair<int, int>, int> found;
    for (std::size_t leaf = 0; leaf < tree.leaf_count(); ++leaf)
        tree.for_each_pair_of(leaf, [&](int t, int u) { ++found[std::minmax(t, u)]; });
    return found;
}

class InBoxTree : public ::testing::TestWithParam<int> {
protected:
    /// All but every fifth triangle.
    InBoxTree() : mesh(strewn(GetParam())) {
        for (int t = 0; t < GetParam(); ++t) some.push_back(t % 5 != 0);
        for (const Vec3& p : mesh.points) all.extend(p);
    }
    Box box(int t) const { return box_of(mesh.points, mesh.triangles[t]); }
    /// Rounded to floats they may.
    bool nearly_meet(const Box& a, const Box& b) const {
        const Vec3 margin = Vec3::Constant(2e-7 * all.sizes().maxCoeff());
        return Box(a.min() - margin, a.max() + margin).intersects(b);
    }

    TriangleMesh mesh;
    std::vector<char> some;
    Box all;
};

TEST_P(InBoxTree, PairsThatMeetAreFoundOnce) {
    const auto found = pairs_in(BoxTree(mesh.points, mesh.triangles, some));
    std::size_t meeting = 0;
    for (int t = 0; t < GetParam(); ++t)
        for (int u = t + 1; u < GetParam(); ++u) {
            if (!some[t] || !some[u] || !box(t).intersects(box(u))) continue;
            EXPECT_EQ(found.count({t, u}), 1u) << t << " and " << u;
            ++meeting;
        }
    for (const auto& [pair, times] : found) {
        EXPECT_EQ(times, 1);
        EXPECT_TRUE(some[pair.first] && some[pair.second] && pair.first != pair.second);
        EXPECT_TRUE(nearly_meet(box(pair.first), box(pair.second)));
    }
    if (GetParam() > 100) {
        EXPECT_GT(meeting, 100u);
    }
}

TEST_P(InBoxTree, ThoseThatMeetABoxAreFoundOnce) {
    const BoxTree tree(mesh.points, mesh.triangles, some);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (int round = 0; round < 100; ++round) {
        const Vec3 low(uniform(random), uniform(random), uniform(random));
        const Box there(low, low + Vec3::Constant(0.5 + 0.5 * uniform(random)));
        std::vector<int> found;
        tree.for_each_meeting(there, [&](int t) { found.push_back(t); });
        std::sort(found.begin(), found.end());
        EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
        for (int t = 0; t < GetParam(); ++t) {
            const bool is_found = std::binary_search(found.begin(), found.end(), t);
            const bool is_wanted = some[t] && there.intersects(box(t)),
                       may_be = some[t] && nearly_meet(there, box(t));
            EXPECT_TRUE(is_found || !is_wanted);
            EXPECT_TRUE(may_be || !is_found);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Triangles, InBoxTree, ::testing::Values(0, 1, 15, 20, 21, 40, 700));

TEST(BoxTree, TellsApartWhatIsInASmallPartOfSpace) {
    constexpr int kCount = 600;
    constexpr double kExtent = 1e-6;
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-kExtent, kExtent);
    TriangleMesh mesh;
    mesh.points = {Vec3(-1, -1, -1), Vec3(0, -1, -1), Vec3(-1, 0, -1)};
    mesh.triangles = {{0, 1, 2}};
    for (int t = 1; t < kCount; ++t) {
        const Vec3 middle(uniform(random), uniform(random), uniform(random));
        for (int k = 0; k < 3; ++k)
            mesh.points.push_back(middle + 0.05 * Vec3(uniform(random), uniform(random), uniform(random)));
        mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    const auto found = pairs_in(BoxTree(mesh.points, mesh.triangles, std::vector<char>(kCount, 1)));
    for (int t = 0; t < kCount; ++t)
        for (int u = t + 1; u < kCount; ++u)
            if (box_of(mesh.points, mesh.triangles[t]).intersects(box_of(mesh.points, mesh.triangles[u]))) {
                EXPECT_EQ(found.count({t, u}), 1u);
            }
    EXPECT_LT(found.size(), std::size_t{kCount * kCount / 20});
}

TEST(BoxTree, TakesPlacesFartherApartThanAnyNumber) {
    TriangleMesh mesh;
    const double far = 1.7e308;
    mesh.points = {Vec3(-far, 0, 0), Vec3(far, 0, 0), Vec3(0, far, 1)};
    mesh.triangles.assign(300, {0, 1, 2});
    EXPECT_EQ(pairs_in(BoxTree(mesh.points, mesh.triangles, std::vector<char>(300, 1))).size(),
              300u * 299u / 2u);
}

TEST(BoxTree, TakesTrianglesOfOnePlace) {
    TriangleMesh mesh;
    mesh.points = {Vec3(1, 2, 3)};
    mesh.triangles.assign(300, {0, 0, 0});
    EXPECT_EQ(pairs_in(BoxTree(mesh.points, mesh.triangles, std::vector<char>(300, 1))).size(),
              300u * 299u / 2u);
}

}  // namespace
}  // namespace isotrack
