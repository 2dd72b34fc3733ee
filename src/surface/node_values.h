// Reading a grid node by node, fast.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstring>
#include <memory>

namespace isotrack {

/// Values at lattice nodes, through the leaves met lately: neighbouring leaves have places of their own.
class NodeValues {
    using Coord = openvdb::Coord;
    using Leaf = openvdb::FloatTree::LeafNodeType;
    static constexpr int kLeafDim = Leaf::DIM;

public:
    explicit NodeValues(const openvdb::FloatTree& tree) : tree_(tree) {}

    float at(const Coord& node) {
        constexpr int kMask = kLeafDim - 1;
        return leaf(node)[offset(node.x() & kMask, node.y() & kMask) + (node.z() & kMask)];
    }

    /// Those of N^3 nodes from `low` on. With N = 4 the columns at the corners of the first two axes are left
    /// out.
    template <int N>
    void block(const Coord& low, float (&v)[N][N][N]) {
        static_assert(N <= kLeafDim, "two leaves in a row hold all");
        const Coord in_leaf = low & (kLeafDim - 1);
        const float* leaves[2][2][2];
        for (int a = 0; a <= (in_leaf.x() + N > kLeafDim); ++a)
            for (int b = 0; b <= (in_leaf.y() + N > kLeafDim); ++b)
                for (int c = 0; c <= (in_leaf.z() + N > kLeafDim); ++c)
                    leaves[a][b][c] = leaf(low.offsetBy(kLeafDim * a, kLeafDim * b, kLeafDim * c));
        const int here = std::min(N, kLeafDim - in_leaf.z());  // of each column, in the first leaf
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < N; ++j) {
                if (N == 4 && (i == 0 || i == 3) && (j == 0 || j == 3)) continue;
                const int x = in_leaf.x() + i, y = in_leaf.y() + j;
                const auto& column = leaves[x / kLeafDim][y / kLeafDim];
                const int at = offset(x % kLeafDim, y % kLeafDim);
                if (here == N) {
                    std::memcpy(v[i][j], column[0] + at + in_leaf.z(), sizeof v[i][j]);
                } else {
                    for (int k = 0; k < here; ++k) v[i][j][k] = column[0][at + in_leaf.z() + k];
                    for (int k = here; k < N; ++k) v[i][j][k] = column[1][at + k - here];
                }
            }
    }

private:
    struct Place {
        const float* values = nullptr;
        Coord leaf;                     // in leaves
        std::unique_ptr<float[]> tile;  // as many values as a leaf has, all the same
    };

    /// The values of the leaf that holds a node, or would.
    const float* leaf(const Coord& node) {
        const Coord at = node >> static_cast<int>(Leaf::LOG2DIM);
        Place& place = places_[((at.x() & 3) << 4) | ((at.y() & 3) << 2) | (at.z() & 3)];
        if (!place.values || place.leaf != at) fetch(node, at, place);
        return place.values;
    }
    void fetch(const Coord& node, const Coord& at, Place& place) {
        place.leaf = at;
        if (const Leaf* found = tree_.probeConstLeaf(node)) {
            place.values = found->buffer().data();
            return;
        }
        if (!place.tile) place.tile = std::make_unique<float[]>(Leaf::SIZE);
        std::fill_n(place.tile.get(), Leaf::SIZE, tree_.getValue(node));
        place.values = place.tile.get();
    }
    static int offset(int x, int y) { return (x * kLeafDim + y) * kLeafDim; }

    const openvdb::FloatTree& tree_;
    Place places_[64];
};

}  // namespace isotrack
