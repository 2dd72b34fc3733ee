// Which nodes in and next to a leaf are inside.
#pragma once

#include <openvdb/openvdb.h>
#ifdef __SSE__
#include <xmmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace isotrack {

/// An accessor that its tree does not know of, and must outlive it.
using TreeReader = openvdb::tree::ValueAccessor<const openvdb::FloatTree, false>;

/// Which nodes of leaves are inside, remembered of those asked for last: their values are read once, though
/// the leaves around them ask as well. For one thread. Notices values that are not finite.
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
            std::array<float, kDim> zero{};  // stays so unless a value is not finite
            for (std::uint64_t& layer : place.layers) {
                layer = 0;
                for (int y = 0; y < kDim; ++y, values += kDim) {
                    layer |= static_cast<std::uint64_t>(negative(values)) << kDim * y;
                    for (int z = 0; z < kDim; ++z) zero[z] += values[z] * 0.0f;
                }
            }
            finite_ = finite_ && std::all_of(zero.begin(), zero.end(), [](float sum) { return sum == 0.0f; });
        }
        return place.layers;
    }
    /// Whether all values read so far are.
    bool are_finite() const { return finite_; }

private:
    static constexpr int kShift = 64 - 11;
    static constexpr std::size_t kPlaces = std::size_t{1} << 11;
    static constexpr std::uint64_t kMix = 0x9e3779b97f4a7c15;
    struct Place {
        const Leaf* leaf = nullptr;
        Layers layers;
    };

    /// Bit i: whether values[i] is below 0.
    static unsigned negative(const float* values) {
#ifdef __SSE__
        const auto four = [](const float* v) {
            return static_cast<unsigned>(_mm_movemask_ps(_mm_cmplt_ps(_mm_loadu_ps(v), _mm_setzero_ps())));
        };
        return four(values) | four(values + 4) << 4;
#else
        unsigned result = 0;
        for (int i = 0; i < kDim; ++i) result |= static_cast<unsigned>(values[i] < 0.0f) << i;
        return result;
#endif
    }

    std::vector<Place> places_;
    bool finite_ = true;
};

/// Of a leaf's nodes and those one beyond its upper ends.
struct LeafSides {
    using Leaf = LeafSigns::Leaf;
    static constexpr int kDim = LeafSigns::kDim;

    /// Bit z of row (x, y).
    std::array<std::array<unsigned, kDim + 1>, kDim + 1> row{};

    LeafSides(const Leaf& leaf, TreeReader& reader, LeafSigns& signs) {
        for (int upper = 0; upper < 8; ++upper) {
            const int i = upper >> 2, j = upper >> 1 & 1, k = upper & 1;
            const openvdb::Coord at = leaf.origin().offsetBy(kDim * i, kDim * j, kDim * k);
            const Leaf* home = upper == 0 ? &leaf : reader.probeConstLeaf(at);
            LeafSigns::Layers tile;
            if (!home) tile.fill(reader.getValue(at) < 0.0f ? ~std::uint64_t{0} : 0);
            const LeafSigns::Layers& layers = home ? signs.of(*home) : tile;
            for (int x = 0; x < (i ? 1 : kDim); ++x)
                for (int y = 0; y < (j ? 1 : kDim); ++y) {
                    const auto bits = static_cast<unsigned>(layers[x] >> kDim * y);
                    row[x + kDim * i][y + kDim * j] |= (bits & (k ? 1u : 0xffu)) << kDim * k;
                }
        }
    }

    /// Whether some are inside and some are not.
    bool are_mixed() const {
        unsigned any = 0, all = ~0u;
        for (const auto& rows : row)
            for (const unsigned bits : rows) any |= bits, all &= bits;
        return any != 0 && all != (1u << (kDim + 1)) - 1u;
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
};

}  // namespace isotrack
