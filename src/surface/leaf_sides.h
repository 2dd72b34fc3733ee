// Which nodes in and next to a leaf are inside.
#pragma once

#include <openvdb/openvdb.h>
#ifdef __SSE__
#include <xmmintrin.h>
#endif

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace isotrack {

/// Calls `visit(bit)` for each that is set.
template <typename Visit>
void for_each_bit(std::uint64_t bits, const Visit& visit) {
    for (; bits != 0; bits &= bits - 1) visit(__builtin_ctzll(bits));
}

/// An accessor that its tree does not know of, and must outlive it.
using TreeReader = openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>;

/// Which nodes of leaves are inside, remembered of those asked for last: their values are mostly read once,
/// though the leaves around them ask as well. For one thread, as long as the leaves neither change nor go;
/// 40 kB. Notices values that are not finite.
class LeafSigns {
public:
    using Leaf = openvdb::FloatTree::LeafNodeType;
    static constexpr int kDim = Leaf::DIM;
    static_assert(kDim == 8, "a layer of a leaf is a word");

    /// Bit 8 y + z of layer x.
    using Layers = std::array<std::uint64_t, kDim>;

    LeafSigns() : places_(kPlaces) {}
    /// Until the next call.
    const Layers& of(const Leaf& leaf) {
        Place& place = places_[reinterpret_cast<std::uintptr_t>(&leaf) * kMix >> kShift];
        if (place.leaf != &leaf) {
            place.leaf = &leaf;
            const float* values = leaf.buffer().data();
            Rows rows;
            for (std::uint64_t& layer : place.layers) {
                layer = 0;
                for (int y = 0; y < kDim; ++y, values += kDim)
                    layer |= static_cast<std::uint64_t>(rows.negative(values)) << kDim * y;
            }
            finite_ = finite_ && rows.are_finite();
        }
        return place.layers;
    }
    /// Whether all values read so far are.
    bool are_finite() const { return finite_; }

private:
    static constexpr int kShift = 64 - 9;
    static constexpr std::size_t kPlaces = std::size_t{1} << 9;
    static constexpr std::uint64_t kMix = 0x9e3779b97f4a7c15;
    struct Place {
        const Leaf* leaf = nullptr;
        Layers layers;
    };

    /// Reads values by rows of eight.
    class Rows {
    public:
        /// Bit i: whether values[i] is below 0.
        unsigned negative(const float* values) { return four(values) | four(values + 4) << 4; }
        /// Whether all values read so far are.
        bool are_finite() const {
#ifdef __SSE__
            return _mm_movemask_ps(_mm_cmpneq_ps(taken_, _mm_setzero_ps())) == 0;
#else
            return taken_ == 0.0f;
#endif
        }

    private:
        unsigned four(const float* values) {
#ifdef __SSE__
            const __m128 v = _mm_loadu_ps(values);
            taken_ = _mm_or_ps(taken_, _mm_sub_ps(v, v));
            return static_cast<unsigned>(_mm_movemask_ps(_mm_cmplt_ps(v, _mm_setzero_ps())));
#else
            unsigned result = 0;
            for (int i = 0; i < 4; ++i) {
                taken_ += values[i] - values[i];
                result |= static_cast<unsigned>(values[i] < 0.0f) << i;
            }
            return result;
#endif
        }

        // Each value taken from itself: zero unless one is not finite.
#ifdef __SSE__
        __m128 taken_ = _mm_setzero_ps();
#else
        float taken_ = 0.0f;
#endif
    };

    std::vector<Place> places_;
    bool finite_ = true;
};

/// Which of a leaf's nodes, and of those one beyond its upper ends, are inside.
class LeafSides {
public:
    using Leaf = LeafSigns::Leaf;
    static constexpr int kDim = LeafSigns::kDim;

    LeafSides(const Leaf& leaf, TreeReader& reader, LeafSigns& signs)
        : LeafSides(leaf.origin(), &leaf, reader, signs) {}
    /// `leaf`: the one at `origin`, null where a tile is.
    LeafSides(const openvdb::Coord& origin, const Leaf* leaf, TreeReader& reader, LeafSigns& signs) {
        for (const int i : {0, 1}) {
            // Of this leaf or the one beyond it along the first axis, and of those further along the others.
            LeafSigns::Layers layers[2][2];
            for (const int j : {0, 1})
                for (const int k : {0, 1}) {
                    const openvdb::Coord at = origin.offsetBy(kDim * i, kDim * j, kDim * k);
                    const Leaf* home = i + j + k == 0 ? leaf : reader.probeConstLeaf(at);
                    if (home)
                        layers[j][k] = signs.of(*home);
                    else
                        layers[j][k].fill(reader.getValue(at) < 0.0f ? ~std::uint64_t{0} : 0);
                }
            const auto next_y = [](std::uint64_t here, std::uint64_t beyond) {
                return here >> kDim | beyond << (kDim - 1) * kDim;
            };
            const auto next_z = [](std::uint64_t here, std::uint64_t beyond) {
                return (here >> 1 & ~(kFirstZ << (kDim - 1))) | (beyond & kFirstZ) << (kDim - 1);
            };
            for (int x = 0; x < (i ? 1 : kDim); ++x) {
                auto& word = word_[x + kDim * i];
                word[0][0] = layers[0][0][x];
                word[0][1] = next_z(layers[0][0][x], layers[0][1][x]);
                word[1][0] = next_y(layers[0][0][x], layers[1][0][x]);
                word[1][1] = next_z(word[1][0], next_y(layers[0][1][x], layers[1][1][x]));
            }
        }
    }

    /// Bit 8 y + z: whether node (x, y + j, z + k) is inside; x from 0 to 8, j and k 0 or 1.
    std::uint64_t word(int x, int j, int k) const { return word_[x][j][k]; }

    /// Whether some are inside and some are not.
    bool are_mixed() const {
        std::uint64_t any = 0, all = ~std::uint64_t{0};
        for (const auto& words : word_)
            for (const auto& pair : words)
                for (const std::uint64_t bits : pair) any |= bits, all &= bits;
        return any != 0 && all != ~std::uint64_t{0};
    }

    /// Bit z of row (x, y): all from 0 to 8.
    unsigned row(int x, int y) const {
        const int beyond = y == kDim, at = kDim * (y - beyond);
        return static_cast<unsigned>((word_[x][beyond][0] >> at & 0xffu) |
                                     (word_[x][beyond][1] >> (at + kDim - 1) & 1u) << kDim);
    }

    /// Bit 8 u + w of layer `at` (0 to 8) across an axis; u, w along the others in their order.
    std::uint64_t layer(int axis, int at) const {
        if (axis == 0) return word_[at][0][0];
        constexpr std::uint64_t kGather = 0x0102040810204080;  // bit 8 y to bit 56 + y
        const int beyond = at == kDim, in = at - beyond;
        std::uint64_t result = 0;
        for (int x = 0; x < kDim; ++x) {
            const std::uint64_t bits = axis == 1 ? word_[x][beyond][0] >> kDim * in & 0xffu
                                                 : (word_[x][0][beyond] >> in & kFirstZ) * kGather >> 56;
            result |= bits << kDim * x;
        }
        return result;
    }

private:
    static constexpr std::uint64_t kFirstZ = 0x0101010101010101;

    std::uint64_t word_[kDim + 1][2][2];
};

/// Calls `visit(origin, below, tile_inside)` for the parts of tiles next to a leaf that are before it along
/// axes where `below` is 1, one at least, unless all nodes beside them, of the leaf and one beyond its upper
/// ends, are on the side of the tile.
template <typename Visit>
void for_each_tile_below(const LeafSides::Leaf& leaf, const LeafSides& sides, TreeReader& reader,
                         const Visit& visit) {
    constexpr int kDim = LeafSides::kDim;
    for (int lower = 1; lower < 8; ++lower) {
        const openvdb::Coord below(lower >> 2, lower >> 1 & 1, lower & 1);
        const openvdb::Coord home =
            leaf.origin().offsetBy(-kDim * below.x(), -kDim * below.y(), -kDim * below.z());
        if (reader.probeConstLeaf(home)) continue;
        const bool tile_inside = reader.getValue(home) < 0.0f;
        const unsigned bits = below.z() ? 1u : 0x1ffu;
        bool all_same = true;
        for (int x = 0; x <= (below.x() ? 0 : kDim); ++x)
            for (int y = 0; y <= (below.y() ? 0 : kDim); ++y)
                all_same = all_same && (sides.row(x, y) & bits) == (tile_inside ? bits : 0u);
        if (!all_same) visit(home, below, tile_inside);
    }
}

}  // namespace isotrack
