#include "surface/leaf_table.h"

#include <gtest/gtest.h>

#include <random>

namespace isotrack {
namespace {

TEST(LeafTable, HasTheValuesOfEveryLeafAndOfNothingElse) {
    using openvdb::Coord;
    auto grid = openvdb::FloatGrid::create(3.0f);
    auto values = grid->getAccessor();
    std::mt19937 random(5);
    const auto anywhere = [&](int reach) {
        const auto some = [&] { return static_cast<int>(random() % (2 * reach)) - reach; };
        return Coord(some(), some(), some());
    };
    for (int n = 0; n < 3000; ++n)
        values.setValue(anywhere(200), static_cast<float>(n));  // on both sides of 0
    for (int n = 0; n < 30; ++n) values.setValue(anywhere(1000000), 0.5f);
    const LeafTable table(grid->constTree());
    std::size_t leaves = 0;
    for (auto leaf = grid->constTree().cbeginLeaf(); leaf; ++leaf, ++leaves)
        EXPECT_EQ(table.values_of(leaf->origin() >> 3), leaf->buffer().data());
    EXPECT_GT(leaves, 1000u);
    std::size_t missing = 0;
    for (int n = 0; n < 3000; ++n) {
        const Coord node = anywhere(250);
        const auto* leaf = grid->constTree().probeConstLeaf(node);
        EXPECT_EQ(table.values_of(node >> 3), leaf ? leaf->buffer().data() : nullptr);
        missing += leaf == nullptr;
    }
    EXPECT_GT(missing, 100u);
}

TEST(LeafTable, LeavesWhatIsFarOffToTheTree) {
    auto grid = openvdb::FloatGrid::create(3.0f);
    auto values = grid->getAccessor();
    constexpr int kFar = 1 << 30, kWrapped = 1 << 24;  // nodes
    values.setValue({kFar, 0, 0}, 1.0f);
    values.setValue({0, 0, 0}, 1.0f);
    const LeafTable table(grid->constTree());
    EXPECT_NE(table.values_of({0, 0, 0}), nullptr);
    EXPECT_EQ(table.values_of({kFar / 8, 0, 0}), nullptr);
    EXPECT_EQ(table.values_of({kWrapped / 8, 0, 0}), nullptr);
    EXPECT_EQ(table.values_of({0, -kFar / 8, 0}), nullptr);
}

TEST(LeafTable, IsEmptyWithoutLeaves) {
    EXPECT_EQ(LeafTable().values_of({0, 0, 0}), nullptr);
    EXPECT_EQ(LeafTable(openvdb::FloatTree(1.0f)).values_of({-1, 2, 3}), nullptr);
}

}  // namespace
}  // namespace isotrack
