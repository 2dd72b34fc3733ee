#include "surface/crossed_edges.h"

#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <map>
#include <numeric>

#include "find_in_blocks.h"
#include "surface/cell_parts.h"

namespace isotrack {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;
using Bits = std::uint64_t;

constexpr int kDim = LeafSides::kDim;
constexpr std::size_t kLeavesPerBlock = 64;

/// Calls `visit(bit)` for each that is set.
template <typename Visit>
void for_each_bit(Bits bits, const Visit& visit) {
    for (; bits != 0; bits &= bits - 1) visit(__builtin_ctzll(bits));
}

constexpr int kStride[3] = {kDim * kDim, kDim, 1};

/// Of the node at bit `i` of a layer of a leaf across `axis`, the one number `at`.
int offset_in(int axis, int at, int i) {
    const int u = i / kDim, w = i % kDim;
    return at * kStride[axis] + u * kStride[axis == 0 ? 1 : 0] + w * kStride[axis == 2 ? 1 : 2];
}

void add_edges_of(const Leaf& leaf, const LeafSides& sides, const FloatTree& tree, TreeReader& reader,
                  std::vector<CrossedEdge>& found) {
    const float* own = leaf.buffer().data();
    const Coord origin = leaf.origin();
    constexpr int kNotLookedAt = 7;
    const auto add = [&](const Coord& from, int axis, float a, float b, bool active, int saddles) {
        const float fraction = std::clamp(a / (a - b), 0.0f, 1.0f);
        found.push_back({from, fraction, static_cast<std::int8_t>(axis), a < 0.0f, !active,
                         static_cast<std::uint8_t>(saddles)});
    };
    const auto is_on = [](const Leaf& of, int offset) {
        return of.isValueOn(static_cast<openvdb::Index>(offset));
    };
    constexpr Bits kNotLastY = 0x00ffffffffffffff, kNotLastZ = 0x7f7f7f7f7f7f7f7f;
    Bits next = sides.layer(0, 0);
    for (int x = 0; x < kDim; ++x) {
        const Bits here = next;
        if (x + 1 < kDim) next = sides.layer(0, x + 1);
        const Bits crossed[3] = {here ^ next, (here ^ here >> kDim) & kNotLastY,
                                 (here ^ here >> 1) & kNotLastZ};
        // Of the faces that an edge spans with one along a further axis; those that leave the leaf may be
        // any.
        const auto saddles = [](Bits edges, Bits opposite, Bits beside, Bits within) {
            return ~within | (edges & opposite & beside);
        };
        const Bits along_y[3] = {saddles(crossed[0], crossed[0] >> kDim, here ^ here >> kDim, kNotLastY), 0,
                                 0};
        const Bits along_z[3] = {
            saddles(crossed[0], crossed[0] >> 1, here ^ here >> 1, kNotLastZ),
            saddles(here ^ here >> kDim, (here ^ here >> kDim) >> 1, here ^ here >> 1, kNotLastY & kNotLastZ),
            0};
        for (int axis = 0; axis < 3; ++axis)
            for_each_bit(crossed[axis], [&](int bit) {
                const int offset = kDim * kDim * x + bit, beyond = offset + kStride[axis];
                add(origin + Leaf::offsetToLocalCoord(offset), axis, own[offset], own[beyond],
                    is_on(leaf, offset) && is_on(leaf, beyond),
                    static_cast<int>((along_y[axis] >> bit & 1) << 1 | (along_z[axis] >> bit & 1) << 2));
            });
    }
    // Across the leaf's faces: upwards always, downwards only where no leaf sees the edge from below.
    for (int axis = 0; axis < 3; ++axis) {
        Coord step(0);
        step[axis] = kDim;
        const auto cross_into_tile = [&](bool up) {
            const Coord there = up ? origin + step : origin - step;
            const float tile = tree.getValue(there);
            const bool active = tree.isValueOn(there);
            const int at = up ? kDim - 1 : 0;
            for_each_bit(sides.layer(axis, at) ^ (tile < 0.0f ? ~Bits{0} : 0), [&](int i) {
                const int offset = offset_in(axis, at, i);
                Coord from = origin + Leaf::offsetToLocalCoord(offset);
                if (!up) from[axis] -= 1;
                add(from, axis, up ? own[offset] : tile, up ? tile : own[offset],
                    active && is_on(leaf, offset), kNotLookedAt);
            });
        };
        if (const Leaf* above = reader.probeConstLeaf(origin + step)) {
            const float* other = above->buffer().data();
            for_each_bit(sides.layer(axis, kDim - 1) ^ sides.layer(axis, kDim), [&](int i) {
                const int offset = offset_in(axis, kDim - 1, i), beyond = offset_in(axis, 0, i);
                add(origin + Leaf::offsetToLocalCoord(offset), axis, own[offset], other[beyond],
                    is_on(leaf, offset) && is_on(*above, beyond), kNotLookedAt);
            });
        } else {
            cross_into_tile(true);
        }
        if (!reader.probeConstLeaf(origin - step)) cross_into_tile(false);
    }
}

}  // namespace

CrossedEdges find_crossed_edges(const FloatTree& tree) {
    const openvdb::tree::LeafManager<const FloatTree> leaves(tree);
    const std::size_t count = leaves.leafCount();
    std::vector<std::size_t> edges_of(count);  // how many, of each leaf
    std::vector<long> parts_of(count);
    CrossedEdges result;
    result.edges = find_in_blocks<CrossedEdge>(
        count, kLeavesPerBlock, [&](std::size_t begin, std::size_t end, std::vector<CrossedEdge>& found) {
            TreeReader reader(tree);
            for (std::size_t n = begin; n < end; ++n) {
                const std::size_t before = found.size();
                const Leaf& leaf = leaves.leaf(n);
                const LeafSides sides(leaf, reader);
                add_edges_of(leaf, sides, tree, reader, found);
                edges_of[n] = found.size() - before;
                parts_of[n] = cell_parts(leaf, sides, reader);
            }
        });
    result.cell_parts = std::accumulate(parts_of.begin(), parts_of.end(), 0L);
    std::size_t last = 0;
    for (std::size_t n = 0; n < count; ++n) {
        const std::size_t end = last + edges_of[n];
        if (end > last) result.parts.push_back({leaves.leaf(n).origin(), last, end});
        last = end;
    }
    return result;
}

namespace {

/// Which of the cubes of a leaf holds a node, or is next to one that is just below the leaf.
std::size_t number_of(const Coord& in_leaf, int cube) {
    const int across = kDim / cube;
    const auto at = [&](int axis) { return std::max(in_leaf[axis], 0) / cube; };
    return static_cast<std::size_t>((at(0) * across + at(1)) * across + at(2));
}

}  // namespace

std::vector<std::size_t> thin_out(const CrossedEdges& crossed, int cube) {
    constexpr std::size_t kNone = ~std::size_t{0};
    const int across = kDim / cube;
    struct Cube {
        int count[3];         // of edges along each axis
        std::size_t some[6];  // the last of each direction
    };
    const auto find = [&](std::size_t begin, std::size_t end, std::vector<std::size_t>& found) {
        std::vector<Cube> cubes(static_cast<std::size_t>(across * across * across));
        for (std::size_t n = begin; n < end; ++n) {
            const CrossedEdges::Part& part = crossed.parts[n];
            for (Cube& c : cubes) {
                std::fill_n(c.count, 3, 0);
                std::fill_n(c.some, 6, kNone);
            }
            for (std::size_t e = part.begin; e < part.end; ++e) {
                const CrossedEdge& edge = crossed.edges[e];
                Cube& c = cubes[number_of(edge.from - part.origin, cube)];
                ++c.count[edge.axis];
                c.some[2 * edge.axis + edge.outward] = e;
            }
            for (const Cube& c : cubes) {
                const auto axis = std::max_element(c.count, c.count + 3) - c.count;
                for (const std::size_t e : {c.some[2 * axis], c.some[2 * axis + 1]})
                    if (e != kNone) found.push_back(e);
            }
        }
    };
    return find_in_blocks<std::size_t>(crossed.parts.size(), kLeavesPerBlock, find);
}

std::vector<std::size_t> edges_near(const CrossedEdges& crossed, const std::vector<Vec3>& places,
                                    double reach, int cube) {
    const int across = kDim / cube;
    std::map<Coord, std::vector<char>> wanted;  // of each leaf, by its origin, its cubes
    for (const Vec3& place : places) {
        const Eigen::Array3i low = ((place.array() - reach) / cube).floor().cast<int>(),
                             high = ((place.array() + reach) / cube).floor().cast<int>();
        for (int x = low.x(); x <= high.x(); ++x)
            for (int y = low.y(); y <= high.y(); ++y)
                for (int z = low.z(); z <= high.z(); ++z) {
                    const Coord node(x * cube, y * cube, z * cube), origin = node & ~(kDim - 1);
                    auto& cubes = wanted[origin];
                    cubes.resize(static_cast<std::size_t>(across * across * across), 0);
                    cubes[number_of(node - origin, cube)] = 1;
                }
    }
    const auto find = [&](std::size_t begin, std::size_t end, std::vector<std::size_t>& found) {
        for (std::size_t n = begin; n < end; ++n) {
            const CrossedEdges::Part& part = crossed.parts[n];
            const auto cubes = wanted.find(part.origin);
            if (cubes == wanted.end()) continue;
            for (std::size_t e = part.begin; e < part.end; ++e)
                if (cubes->second[number_of(crossed.edges[e].from - part.origin, cube)]) found.push_back(e);
        }
    };
    return find_in_blocks<std::size_t>(crossed.parts.size(), kLeavesPerBlock, find);
}

}  // namespace isotrack
