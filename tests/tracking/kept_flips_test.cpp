// Flips that are carried over, and those that cannot be.
#include "tracking/kept_flips.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

namespace isotrack {
namespace {

/// A strip of quadrilaterals, cut in two triangles each: vertices 2 i below, 2 i + 1 above. Vertex v stands
/// on particle v + 10.
struct Strip : ::testing::Test {
    static constexpr int kQuads = 6, kParticles = 2 * kQuads + 12;
    CarvedSurface carved;
    std::vector<Triangle> before;
    std::vector<int> vertex = std::vector<int>(kParticles, -1), same;
    std::vector<char> around = std::vector<char>(2 * kQuads + 2, 0);

    Strip() {
        for (int i = 0; i < kQuads; ++i) {
            carved.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 3});
            carved.triangles.push_back({2 * i, 2 * i + 3, 2 * i + 1});
        }
        for (int v = 0; v < 2 * kQuads + 2; ++v) {
            carved.particle.push_back(v + 10);
            vertex[v + 10] = v;
        }
        before = carved.triangles;
        same.resize(before.size());
        std::iota(same.begin(), same.end(), 0);
    }
    void flip(int quad) {
        carved.triangles[2 * quad] = {2 * quad, 2 * quad + 2, 2 * quad + 1};
        carved.triangles[2 * quad + 1] = {2 * quad + 2, 2 * quad + 3, 2 * quad + 1};
    }
    /// Those of quadrilaterals 1, 3 and 4, of which the last two have two vertices in common.
    KeptFlips some_flips() {
        for (const int quad : {1, 3, 4}) flip(quad);
        return KeptFlips({{2, 3}, {6, 7}, {8, 9}}, before, carved);
    }
};

TEST_F(Strip, GetsItsFlipsAgain) {
    KeptFlips flips = some_flips();
    const std::vector<Triangle> after = carved.triangles;
    carved.triangles = before;
    flips.put_into(carved, same, vertex, around);
    EXPECT_EQ(carved.triangles, after);
    EXPECT_EQ(around, std::vector<char>(around.size(), 0));
}

TEST_F(Strip, GetsThemUnderOtherNumbers) {
    KeptFlips flips = some_flips();
    // Vertices in the opposite order, triangles two farther on.
    const int last = 2 * kQuads + 1;
    const auto renamed = [&](std::vector<Triangle> triangles) {
        for (Triangle& t : triangles)
            for (int& v : t) v = last - v;
        triangles.insert(triangles.begin(), 2, Triangle{0, 0, 0});
        return triangles;
    };
    const std::vector<Triangle> after = renamed(carved.triangles);
    carved.triangles = renamed(before);
    for (int& v : vertex)
        if (v >= 0) v = last - v;
    for (int& t : same) t += 2;
    flips.put_into(carved, same, vertex, around);
    EXPECT_EQ(carved.triangles, after);
    // And once more, from there on.
    carved.triangles = renamed(before);
    std::vector<int> now(carved.triangles.size());
    std::iota(now.begin(), now.end(), 0);
    flips.put_into(carved, now, vertex, around);
    EXPECT_EQ(carved.triangles, after);
}

TEST_F(Strip, ForgetsAFlipThatMissesATriangle) {
    KeptFlips flips = some_flips();
    const std::vector<Triangle> after = carved.triangles;
    carved.triangles = before;
    same[9] = -1;
    flips.put_into(carved, same, vertex, around);
    for (const int t : {2, 3, 6, 7}) EXPECT_EQ(carved.triangles[t], after[t]);
    for (const int t : {8, 9}) EXPECT_EQ(carved.triangles[t], before[t]);
    std::vector<char> expected(around.size(), 0);
    for (const int v : before[8]) expected[v] = 1;
    EXPECT_EQ(around, expected);
    carved.triangles = before;
    std::iota(same.begin(), same.end(), 0);
    flips.put_into(carved, same, vertex, around);
    EXPECT_EQ(carved.triangles[8], before[8]);
    EXPECT_EQ(carved.triangles[6], after[6]);
    EXPECT_EQ(carved.triangles[2], after[2]);
}

TEST_F(Strip, ForgetsThoseOfAParticleThatIsOnSeveralVertices) {
    KeptFlips flips = some_flips();
    const std::vector<Triangle> after = carved.triangles;
    carved.triangles = before;
    vertex[2 + 10] = -2;  // of quadrilateral 1
    flips.put_into(carved, same, vertex, around);
    for (const int t : {2, 3}) EXPECT_EQ(carved.triangles[t], before[t]);
    for (const int t : {6, 7, 8, 9}) EXPECT_EQ(carved.triangles[t], after[t]);
}

TEST_F(Strip, ForgetsThoseWhoseEdgeANewTriangleHas) {
    flip(1);
    KeptFlips flips({{2, 3}}, before, carved);
    carved.triangles = before;
    carved.triangles[7] = {3, 4, 9};  // with the edge that the flip made
    same[7] = -1;
    flips.put_into(carved, same, vertex, around);
    EXPECT_EQ(carved.triangles[2], before[2]);
    EXPECT_EQ(carved.triangles[3], before[3]);
    EXPECT_EQ(std::count(around.begin(), around.end(), 1), 4);
}

TEST_F(Strip, KeepsThoseBesideNewTriangles) {
    flip(1);
    const std::vector<Triangle> after = carved.triangles;
    KeptFlips flips({{2, 3}}, before, carved);
    carved.triangles = before;
    for (const int t : {1, 4}) same[t] = -1;  // new ones with an edge of what was flipped
    flips.put_into(carved, same, vertex, around);
    EXPECT_EQ(carved.triangles, after);
}

TEST_F(Strip, TakesBackThoseAtFlaggedVertices) {
    KeptFlips flips = some_flips();
    const std::vector<Triangle> after = carved.triangles;
    std::vector<char> flagged(around.size(), 0);
    flagged[0] = 1;  // at none of them
    EXPECT_FALSE(flips.undo_at(flagged, vertex, carved));
    EXPECT_EQ(carved.triangles, after);
    flagged[11] = 1;  // of quadrilateral 4 alone, whose others are of 3
    EXPECT_TRUE(flips.undo_at(flagged, vertex, carved));
    for (const int t : {2, 3}) EXPECT_EQ(carved.triangles[t], after[t]);
    for (const int t : {6, 7, 8, 9}) {
        EXPECT_EQ(carved.triangles[t], before[t]);
        for (const int v : before[t]) EXPECT_TRUE(flagged[v]);
    }
    EXPECT_FALSE(flips.undo_at(flagged, vertex, carved));
}

TEST_F(Strip, MayHaveNone) {
    KeptFlips flips;
    flips.put_into(carved, {}, vertex, around);
    EXPECT_EQ(carved.triangles, before);
    around.assign(around.size(), 1);
    EXPECT_FALSE(flips.undo_at(around, vertex, carved));
}

}  // namespace
}  // namespace isotrack
