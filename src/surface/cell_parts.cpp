#include "surface/cell_parts.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cstdint>

#include "disjoint_sets.h"
#include "surface/ambiguous_faces.h"

namespace isotrack {
namespace {

using openvdb::Coord;
using Leaf = openvdb::FloatTree::LeafNodeType;

constexpr int kDim = LeafSides::kDim;

/// How many parts the surface has in a cell with the corners of `mask` inside, bit 4 i + 2 j + k. `joined`:
/// whether the inside corners of an ambiguous face, the one across an axis on a side (0, 1), are.
template <typename Joined>
int parts_of(unsigned mask, const Joined& joined) {
    const auto inside = [&](int corner) { return (mask >> corner & 1u) != 0; };
    // The edge between two corners, by the one bit in which they differ and the lower of them.
    const auto edge = [](int a, int b) { return 8 * ((a ^ b) / 2) + std::min(a, b); };
    DisjointSets edges(8 * 3);
    int parts = 0;
    for (const int bit : {1, 2, 4})
        for (int a = 0; a < 8; ++a)
            if ((a & bit) == 0) parts += inside(a) != inside(a + bit);
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {0, 1}) {
            const int out = 4 >> axis, b = axis == 0 ? 2 : 4, c = axis == 2 ? 2 : 1, at = side * out;
            const int around[] = {at, at + b, at + b + c, at + c};
            int crossed[4], count = 0;
            for (int k = 0; k < 4; ++k)
                if (inside(around[k]) != inside(around[(k + 1) % 4])) crossed[count++] = k;
            const auto unite = [&](int k, int l) {
                parts -=
                    edges.join(edge(around[k], around[(k + 1) % 4]), edge(around[l], around[(l + 1) % 4]));
            };
            if (count == 2) unite(crossed[0], crossed[1]);
            // The surface cuts off the corners that are not joined, each between the edges before and after.
            if (count == 4)
                for (int k = 0; k < 4; ++k)
                    if (inside(around[k]) != joined(axis, side)) unite((k + 3) % 4, k);
        }
    return parts;
}

/// Of cells without an ambiguous face.
const std::array<char, 256> kParts = [] {
    std::array<char, 256> result{};
    for (unsigned mask = 0; mask < 256; ++mask)
        result[mask] = static_cast<char>(parts_of(mask, [](int, int) { return false; }));
    return result;
}();

int parts_at(const Coord& cell, unsigned mask, TreeReader& reader) {
    if (kAmbiguousFaces[mask] == 0) return kParts[mask];
    return parts_of(mask, [&](int axis, int side) {
        return joins_face([&](int i, int j, int k) { return reader.getValue(cell.offsetBy(i, j, k)); }, axis,
                          side);
    });
}

/// Of the cells that have their least node in the leaf.
long parts_in(const Leaf& leaf, const LeafSides& sides, TreeReader& reader) {
    using Bits = std::uint64_t;
    long result = 0;
    for (int x = 0; x < kDim; ++x) {
        Bits inside[2][2][2], any = 0, all = ~Bits{0};  // of all cells with this x: at each corner
        for (int n = 0; n < 8; ++n) {
            const Bits bits = inside[n >> 2][n >> 1 & 1][n & 1] = sides.word(x + (n >> 2), n >> 1 & 1, n & 1);
            any |= bits;
            all &= bits;
        }
        const Bits mixed = any & ~all;
        if (mixed == 0) continue;
        // Those with an ambiguous face or only two opposite corners on a side may have several.
        Bits several = 0;
        const auto add_face = [&](Bits a, Bits b, Bits c, Bits d) {
            several |= ~(a ^ c) & ~(b ^ d) & (a ^ b);
        };
        for (const int side : {0, 1}) {
            const auto& across_x = inside[side];
            add_face(across_x[0][0], across_x[1][0], across_x[1][1], across_x[0][1]);
            add_face(inside[0][side][0], inside[1][side][0], inside[1][side][1], inside[0][side][1]);
            add_face(inside[0][0][side], inside[1][0][side], inside[1][1][side], inside[0][1][side]);
        }
        for (int n = 0; n < 4; ++n) {
            Bits any_other = 0, all_others = ~Bits{0}, any_of_two = 0, both = ~Bits{0};
            for (int m = 0; m < 8; ++m) {
                const Bits bits = inside[m >> 2][m >> 1 & 1][m & 1];
                const bool of_two = m == n || m == 7 - n;
                (of_two ? any_of_two : any_other) |= bits;
                (of_two ? both : all_others) &= bits;
            }
            several |= (both & ~any_other) | (all_others & ~any_of_two);
        }
        several &= mixed;
        result += static_cast<long>(std::bitset<64>(mixed & ~several).count());
        for (; several != 0; several &= several - 1) {
            const int at = __builtin_ctzll(several);
            unsigned mask = 0;
            for (int n = 0; n < 8; ++n)
                mask |= static_cast<unsigned>(inside[n >> 2][n >> 1 & 1][n & 1] >> at & 1u) << n;
            result += parts_at(leaf.origin().offsetBy(x, at / kDim, at % kDim), mask, reader);
        }
    }
    return result;
}

/// Of the cells that have their least node in a tile, and in this leaf the first on the other side.
long parts_below(const Leaf& leaf, const LeafSides& sides, TreeReader& reader) {
    long result = 0;
    for_each_tile_below(leaf, sides, reader, [&](const Coord&, const Coord& below, bool tile_inside) {
        const auto end = [&](int axis) { return below[axis] ? 0 : kDim; };
        const auto begin = [&](int axis) { return -below[axis]; };
        for (int x = begin(0); x < end(0); ++x)
            for (int y = begin(1); y < end(1); ++y)
                for (int z = begin(2); z < end(2); ++z) {
                    const Coord cell = leaf.origin().offsetBy(x, y, z);
                    const auto node = [&](int n) { return cell.offsetBy(n >> 2, n >> 1 & 1, n & 1); };
                    unsigned mask = 0;
                    for (int n = 0; n < 8; ++n)
                        mask |= static_cast<unsigned>(reader.getValue(node(n)) < 0.0f) << n;
                    const unsigned others = tile_inside ? mask ^ 0xffu : mask;
                    if (others != 0 && reader.probeConstLeaf(node(__builtin_ctz(others))) == &leaf)
                        result += parts_at(cell, mask, reader);
                }
    });
    return result;
}

}  // namespace

long cell_parts(const Leaf& leaf, const LeafSides& sides, TreeReader& reader) {
    return (sides.are_mixed() ? parts_in(leaf, sides, reader) : 0) + parts_below(leaf, sides, reader);
}

}  // namespace isotrack
