// Reading a grid node by node, fast.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "surface/leaf_table.h"

namespace isotrack {

/// Values at lattice nodes, through the leaves met lately: neighbouring leaves have places of their own.
class NodeValues {
    using Coord = openvdb::Coord;
    using Leaf = openvdb::FloatTree::LeafNodeType;
    static constexpr int kLeafDim = Leaf::DIM, kMask = kLeafDim - 1;

public:
    /// `table`: of the tree, if there is one. Both must outlive it.
    explicit NodeValues(const openvdb::FloatTree& tree, const LeafTable* table = nullptr)
        : table_(table), leaves_(tree) {
        const float outside = tree.background();
        std::fill_n(far_[0], Leaf::SIZE, outside);
        std::fill_n(far_[1], Leaf::SIZE, -outside);
    }
    NodeValues(const NodeValues&) = delete;  // places point into it
    NodeValues& operator=(const NodeValues&) = delete;

    float at(const Coord& node) {
        return place_of(node).values[offset(node.x() & kMask, node.y() & kMask) + (node.z() & kMask)];
    }

    /// Those of N^3 nodes from `low` on. With N = 4 the columns at the corners of the first two axes are left
    /// out.
    template <int N>
    void block(const Coord& low, float (&v)[N][N][N]) {
        static_assert(N <= kLeafDim, "two leaves in a row hold all");
        // The leaf of a node is found without a branch, which would be mispredicted: it changes from cell to
        // cell.
        const int x = low.x() & kMask, y = low.y() & kMask, z = low.z() & kMask;
        Place& place = place_of(low);
        const auto for_each_column = [&](const auto& read) {
            for (int i = 0; i < N; ++i)
                for (int j = 0; j < N; ++j) {
                    if (N == 4 && (i == 0 || i == 3) && (j == 0 || j == 3)) continue;
                    const int a = (x + i) / kLeafDim, b = (y + j) / kLeafDim;
                    read(v[i][j], place.beyond[a][b], a, b, offset((x + i) & kMask, (y + j) & kMask));
                }
        };
        const auto values = [&](const float*& known, int a, int b, int c) {
            return known ? known : meet(known, low.offsetBy(kLeafDim * a, kLeafDim * b, kLeafDim * c));
        };
        if (z + N <= kLeafDim) {
            for_each_column([&](float(&column)[N], const float*(&leaves)[2], int a, int b, int at) {
                std::memcpy(column, values(leaves[0], a, b, 0) + at + z, sizeof column);
            });
        } else {
            for_each_column([&](float(&column)[N], const float*(&leaves)[2], int a, int b, int at) {
                const float *here = values(leaves[0], a, b, 0) + at, *next = values(leaves[1], a, b, 1) + at;
                for (int k = 0; k < N; ++k) column[k] = (z + k < kLeafDim ? here : next)[(z + k) & kMask];
            });
        }
    }

    /// Brings the nodes of a cell, from `low` on, towards the caches: those in the leaf of `low`.
    void prefetch(const Coord& low) {
        const int x = low.x() & kMask, y = low.y() & kMask, z = low.z() & kMask;
        const float* values = place_of(low).values;
        for (const int i : {x, std::min(x + 1, kMask)})
            for (const int j : {y, std::min(y + 1, kMask)}) __builtin_prefetch(values + offset(i, j) + z);
    }

private:
    struct Place {
        const float* values = nullptr;
        Coord leaf;                         // in leaves
        const float* beyond[2][2][2] = {};  // of the next leaves along the axes, once they were met
        std::unique_ptr<float[]> tile;      // as many values as a leaf has, where far_ has none like them
    };

    /// The place of the leaf that holds a node, or would.
    Place& place_of(const Coord& node) {
        const Coord at = node >> static_cast<int>(Leaf::LOG2DIM);
        Place& place = places_[((at.x() & 3) << 4) | ((at.y() & 3) << 2) | (at.z() & 3)];
        if (!place.values || place.leaf != at) fetch(node, at, place);
        return place;
    }
    void fetch(const Coord& node, const Coord& at, Place& place);
    /// The values of the leaf that holds a node, or would; `known` from now on.
    const float* meet(const float*& known, const Coord& node);
    static int offset(int x, int y) { return (x * kLeafDim + y) * kLeafDim; }

    const LeafTable* table_;
    openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> leaves_;  // one thread's, not registered
    Place places_[64];
    float far_[2][Leaf::SIZE];  // values of most tiles, outside and inside
};

}  // namespace isotrack
