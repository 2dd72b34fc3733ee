// Which nodes in and next to a leaf are inside.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>

namespace isotrack {

/// An accessor that its tree does not know of, and must outlive it.
using TreeReader = openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>;

/// Of a leaf's nodes and those one beyond its upper ends.
struct LeafSides {
    using Leaf = openvdb::FloatTree::LeafNodeType;
    static constexpr int kDim = Leaf::DIM;
    static_assert(kDim == 8, "a layer of a leaf is a word");

    /// Bit z of row (x, y).
    std::array<std::array<unsigned, kDim + 1>, kDim + 1> row{};

    LeafSides(const Leaf& leaf, TreeReader& reader) {
        for (int upper = 0; upper < 8; ++upper) {
            const int i = upper >> 2, j = upper >> 1 & 1, k = upper & 1;
            const openvdb::Coord at = leaf.origin().offsetBy(kDim * i, kDim * j, kDim * k);
            const Leaf* home = upper == 0 ? &leaf : reader.probeConstLeaf(at);
            const unsigned tile = home == nullptr && reader.getValue(at) < 0.0f ? 0xffu : 0u;
            for (int x = 0; x < (i ? 1 : kDim); ++x)
                for (int y = 0; y < (j ? 1 : kDim); ++y) {
                    unsigned bits = tile;
                    if (home) bits = inside(home->buffer().data() + (x * kDim + y) * kDim, k ? 1 : kDim);
                    row[x + kDim * i][y + kDim * j] |= (k ? bits & 1u : bits) << (kDim * k);
                }
        }
    }

    /// Bit 8 u + w of layer `at` (0 to 8) across an axis; u, w along the others in their order.
    std::uint64_t layer(int axis, int at) const {
        std::uint64_t result = 0;
        for (int u = 0; u < kDim; ++u) {
            std::uint64_t bits = 0;
            if (axis == 2)
                for (int w = 0; w < kDim; ++w) bits |= static_cast<std::uint64_t>(row[u][w] >> at & 1u) << w;
            else
                bits = (axis == 0 ? row[at][u] : row[u][at]) & 0xffu;
            result |= bits << (kDim * u);
        }
        return result;
    }

    /// The corners of the cell with this least node, bit 4 i + 2 j + k.
    unsigned of_cell(int x, int y, int z) const {
        const auto pair = [&](unsigned bits) { return bits >> z & 3u; };
        return pair(row[x][y]) | pair(row[x][y + 1]) << 2 | pair(row[x + 1][y]) << 4 |
               pair(row[x + 1][y + 1]) << 6;
    }

private:
    static unsigned inside(const float* values, int count) {
        unsigned result = 0;
        for (int i = 0; i < count; ++i) result |= static_cast<unsigned>(values[i] < 0.0f) << i;
        return result;
    }
};

}  // namespace isotrack
