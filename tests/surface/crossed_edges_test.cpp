// Crossed edges of leaves that have few of them each.
#include "surface/crossed_edges.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <array>
#include <limits>
#include <random>
#include <set>

namespace isotrack {
namespace {

using openvdb::Coord;

/// Nodes inside alone, some of them beside a leaf that is not there, to all sides of the origin.
TEST(CrossedEdges, AreThoseOfDropsInLeavesOfTheirOwn) {
    std::mt19937 random(11);
    std::uniform_int_distribution<int> leaf(-40, 40), node(0, 7);
    std::uniform_real_distribution<float> depth(-0.9f, -0.1f);
    openvdb::FloatTree tree(1.0f);
    std::set<Coord> leaves, drops;
    while (drops.size() < 700) {
        const Coord origin(16 * leaf(random), 16 * leaf(random), 16 * leaf(random));
        if (!leaves.insert(origin).second) continue;
        const Coord drop = origin.offsetBy(node(random), node(random), node(random));
        tree.setValue(drop, depth(random));
        drops.insert(drop);
    }
    const CrossedEdges found = find_crossed_edges(tree);
    ASSERT_TRUE(found.finite());
    ASSERT_EQ(found.size(), 6 * drops.size());
    ASSERT_EQ(found.parts().size(), drops.size());
    std::set<std::array<int, 4>> seen;
    for (std::size_t i = 0; i < found.size(); ++i) {
        const CrossedEdge edge = found[i];
        Coord to = edge.from;
        ++to[edge.axis];
        EXPECT_TRUE(seen.insert({edge.from.x(), edge.from.y(), edge.from.z(), edge.axis}).second);
        EXPECT_EQ(drops.count(edge.outward ? edge.from : to), 1u);
        const float a = tree.getValue(edge.from), b = tree.getValue(to);
        EXPECT_FLOAT_EQ(edge.fraction, a / (a - b));
        EXPECT_TRUE(edge.at_border);  // beyond is the background
    }
    EXPECT_EQ(found.at_border(), found.size());
    std::size_t visited = 0;
    for (const CrossedEdges::Part& part : found.parts())
        found.for_each_of(part, [&](std::size_t i, const CrossedEdge& edge) {
            ++visited;
            EXPECT_EQ(edge.from, found[i].from);
            EXPECT_EQ(edge.axis, found[i].axis);
            EXPECT_EQ(edge.fraction, found[i].fraction);
            EXPECT_EQ(edge.outward, found[i].outward);
            EXPECT_EQ(edge.at_border, found[i].at_border);
            EXPECT_EQ(edge.saddles, found[i].saddles);
            EXPECT_TRUE(edge.saddles == 7 || (edge.from & ~7) == part.origin) << "in a tile";
        });
    EXPECT_EQ(visited, found.size());
    // Six of a part: none, within one, to the end of one, over several, all.
    const std::size_t ranges[][2] = {
        {0, 0}, {found.size(), found.size()}, {7, 11}, {13, 18}, {5, 301}, {0, found.size()}};
    for (const auto& [first, end] : ranges) {
        std::size_t i = first;
        found.for_each_in(first, end, [&](const CrossedEdge& edge) {
            EXPECT_EQ(edge.from, found[i].from);
            EXPECT_EQ(edge.axis, found[i].axis);
            EXPECT_EQ(edge.fraction, found[i].fraction);
            ++i;
        });
        EXPECT_EQ(i, end);
    }
}

TEST(CrossedEdges, KnowTheirBorderAndTheirSaddles) {
    openvdb::FloatTree tree(1.0f);
    for (int x = -2; x <= 3; ++x)
        for (int y = -2; y <= 3; ++y)
            for (int z = -2; z <= 2; ++z) tree.setValue({x, y, z}, 0.5f);
    tree.setValue({0, 0, 0}, -0.5f);  // two across the diagonal of a face
    tree.setValue({1, 1, 0}, -0.5f);
    const CrossedEdges found = find_crossed_edges(tree);
    ASSERT_EQ(found.size(), 12u);
    EXPECT_EQ(found.at_border(), 0u);
    const std::set<std::array<int, 4>> of_saddle{{0, 0, 0, 0}};  // the lowest edge of the face names it
    for (std::size_t i = 0; i < found.size(); ++i) {
        const CrossedEdge edge = found[i];
        const bool lowest = of_saddle.count({edge.from.x(), edge.from.y(), edge.from.z(), edge.axis}) > 0;
        EXPECT_EQ(edge.saddles, lowest ? 1 << 1 : 0) << edge.from << " " << static_cast<int>(edge.axis);
    }
}

TEST(CrossedEdges, AreNoneOfNothingAndOfWhatIsNotFinite) {
    openvdb::FloatTree tree(1.0f);
    EXPECT_TRUE(find_crossed_edges(tree).empty());
    EXPECT_TRUE(find_crossed_edges(tree).finite());
    tree.setValue({1, 2, 3}, -0.5f);
    tree.setValue({1, 2, 4}, std::numeric_limits<float>::quiet_NaN());
    EXPECT_TRUE(find_crossed_edges(tree).empty());
    EXPECT_FALSE(find_crossed_edges(tree).finite());
}

}  // namespace
}  // namespace isotrack
