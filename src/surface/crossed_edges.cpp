#include "surface/crossed_edges.h"

#include <openvdb/tree/LeafManager.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bitset>
#include <numeric>
#include <utility>

#include "surface/cell_parts.h"

namespace isotrack {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;
using Bits = std::uint64_t;

constexpr int kDim = LeafSides::kDim;

constexpr int kStride[3] = {kDim * kDim, kDim, 1};

/// Of the node at bit `i` of a layer of a leaf across `axis`, the one number `at`.
int offset_in(int axis, int at, int i) {
    const int u = i / kDim, w = i % kDim;
    return at * kStride[axis] + u * kStride[axis == 0 ? 1 : 0] + w * kStride[axis == 2 ? 1 : 2];
}

/// The edges along each axis that have both ends in a leaf, the lower one in layer `x` of it: by their lower
/// ends. `next`: the layer above, or once more this one where that is in another leaf.
struct LayerEdges {
    Bits along[3];

    LayerEdges(Bits here, Bits next)
        : along{here ^ next, (here ^ here >> kDim) & kNotLastY, (here ^ here >> 1) & kNotLastZ} {}

    static constexpr Bits kNotLastY = 0x00ffffffffffffff, kNotLastZ = 0x7f7f7f7f7f7f7f7f;
};

/// The faces with all four edges crossed that have their lowest node in a leaf.
class Saddles {
public:
    explicit Saddles(const LeafSides& sides) {
        for (int x = 0; x < kDim; ++x) {
            const Bits here = sides.word(x, 0, 0), at_x = sides.word(x + 1, 0, 0), at_y = sides.word(x, 1, 0),
                       at_z = sides.word(x, 0, 1);
            // Three of the edges are; then so is the fourth.
            const auto face = [&](Bits one, Bits other, Bits both) {
                return (here ^ one) & (here ^ other) & (one ^ both);
            };
            across_z_[x] = face(at_x, at_y, sides.word(x + 1, 1, 0));
            across_y_[x] = face(at_x, at_z, sides.word(x + 1, 0, 1));
            across_x_[x] = face(at_y, at_z, sides.word(x, 1, 1));
        }
    }
    /// `CrossedEdge::saddles` of the edge along an axis from the node with this offset in the leaf.
    int of(int axis, int offset) const {
        const auto is_in = [&](const Bits(&faces)[kDim], int other) {
            return static_cast<int>(faces[offset / (kDim * kDim)] >> offset % (kDim * kDim) & 1) << other;
        };
        if (axis == 0) return is_in(across_z_, 1) | is_in(across_y_, 2);
        return axis == 1 ? is_in(across_x_, 2) : 0;
    }

private:
    Bits across_x_[kDim], across_y_[kDim], across_z_[kDim];
};

/// Calls `visit(x, edges)` for each layer of a leaf.
template <typename Visit>
void for_each_layer(const LeafSides& sides, const Visit& visit) {
    Bits next = sides.layer(0, 0);
    for (int x = 0; x < kDim; ++x) {
        const Bits here = next;
        if (x + 1 < kDim) next = sides.layer(0, x + 1);
        visit(x, LayerEdges(here, next));
    }
}

/// The edges that leave a leaf through one of its faces, by their ends in the leaf; `origin` is that of what
/// is beyond, a leaf or a tile.
struct FaceEdges {
    int axis;
    bool up;
    Coord origin;
    const Leaf* beyond;
    Bits edges;
};

/// Calls `visit(FaceEdges)` for each face: upwards always, downwards only where no leaf sees the edges from
/// below.
template <typename Visit>
void for_each_face(const Leaf& leaf, const LeafSides& sides, TreeReader& reader, const Visit& visit) {
    for (int axis = 0; axis < 3; ++axis) {
        Coord step(0);
        step[axis] = kDim;
        const Coord above = leaf.origin() + step, below = leaf.origin() - step;
        visit(FaceEdges{axis, true, above, reader.probeConstLeaf(above),
                        sides.layer(axis, kDim - 1) ^ sides.layer(axis, kDim)});
        if (!reader.probeConstLeaf(below))
            visit(FaceEdges{axis, false, below, nullptr,
                            sides.layer(axis, 0) ^ (reader.getValue(below) < 0.0f ? ~Bits{0} : 0)});
    }
}

std::size_t count_edges_of(const Leaf& leaf, const LeafSides& sides, TreeReader& reader) {
    std::size_t result = 0;
    const auto add = [&](Bits edges) {
        if (edges != 0) result += std::bitset<64>(edges).count();
    };
    if (sides.are_mixed())
        for_each_layer(sides, [&](int, const LayerEdges& edges) {
            for (const Bits along : edges.along) add(along);
        });
    for_each_face(leaf, sides, reader, [&](const FaceEdges& face) { add(face.edges); });
    return result;
}

/// Calls `visit` with each, as many as `count_edges_of` counts.
template <typename Visit>
void for_each_edge_of(const Leaf& leaf, const LeafSides& sides, TreeReader& reader, const Visit& visit) {
    const float* own = leaf.buffer().data();
    const Saddles saddles(sides);
    constexpr int kNotLookedAt = 7;
    const auto add = [&](const Coord& from, int axis, float a, float b, bool active, int own_saddles) {
        const float fraction = std::clamp(a / (a - b), 0.0f, 1.0f);
        visit(CrossedEdge{from, fraction, static_cast<std::int8_t>(axis), a < 0.0f, !active,
                          static_cast<std::uint8_t>(own_saddles)});
    };
    const auto is_on = [](const Leaf& of, int offset) {
        return of.isValueOn(static_cast<openvdb::Index>(offset));
    };
    for_each_layer(sides, [&](int x, const LayerEdges& edges) {
        for (int axis = 0; axis < 3; ++axis)
            for_each_bit(edges.along[axis], [&](int bit) {
                const int offset = kDim * kDim * x + bit, beyond = offset + kStride[axis];
                add(leaf.offsetToGlobalCoord(offset), axis, own[offset], own[beyond],
                    is_on(leaf, offset) && is_on(leaf, beyond), saddles.of(axis, offset));
            });
    });
    for_each_face(leaf, sides, reader, [&](const FaceEdges& face) {
        if (face.edges == 0) return;
        const float tile = reader.getValue(face.origin);  // where there is one, not a leaf
        const bool is_tile_on = reader.isValueOn(face.origin);
        for_each_bit(face.edges, [&](int i) {
            const int offset = offset_in(face.axis, face.up ? kDim - 1 : 0, i),
                      there = offset_in(face.axis, face.up ? 0 : kDim - 1, i);
            const float inner = own[offset], outer = face.beyond ? face.beyond->buffer().data()[there] : tile;
            Coord from = leaf.offsetToGlobalCoord(offset);
            if (!face.up) from[face.axis] -= 1;
            add(from, face.axis, face.up ? inner : outer, face.up ? outer : inner,
                is_on(leaf, offset) && (face.beyond ? is_on(*face.beyond, there) : is_tile_on),
                face.up ? saddles.of(face.axis, offset) : kNotLookedAt);
        });
    });
}

}  // namespace

CrossedEdges find_crossed_edges(const FloatTree& tree) {
    const openvdb::tree::LeafManager<const FloatTree> leaves(tree);
    const std::size_t count = leaves.leafCount();
    // By blocks: in each they are counted, then written, while their leaves are near at hand.
    constexpr std::size_t kLeaves = 128;  // with fewer a thread knows few of their neighbours
    struct Block {
        UnsetVector<float> fractions;
        UnsetVector<CrossedEdges::Code> codes;
        long cell_parts = 0;
        std::size_t at_border = 0;
    };
    std::vector<Block> blocks((count + kLeaves - 1) / kLeaves);
    std::vector<std::size_t> first(count + 1, 0);
    tbb::enumerable_thread_specific<LeafSigns> signs_of_threads;
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        const std::size_t begin = b * kLeaves, end = std::min(count, begin + kLeaves);
        Block& block = blocks[b];
        TreeReader reader(tree);
        LeafSigns& signs = signs_of_threads.local();
        std::size_t edges = 0;
        for (std::size_t n = begin; n < end; ++n) {
            const Leaf& leaf = leaves.leaf(n);
            const LeafSides sides(leaf, reader, signs);
            edges += first[n + 1] = count_edges_of(leaf, sides, reader);
            block.cell_parts += cell_parts(leaf, sides, reader);
        }
        if (!signs.are_finite()) return;
        block.fractions.resize(edges);
        block.codes.resize(edges);
        std::size_t next = 0;
        for (std::size_t n = begin; n < end; ++n) {
            if (first[n + 1] == 0) continue;
            const Leaf& leaf = leaves.leaf(n);
            for_each_edge_of(leaf, LeafSides(leaf, reader, signs), reader, [&](const CrossedEdge& edge) {
                block.fractions[next] = edge.fraction;
                block.codes[next++] = {edge, leaf.origin()};
                block.at_border += edge.at_border;
            });
        }
    });
    CrossedEdges result;
    for (const LeafSigns& signs : signs_of_threads) result.finite_ = result.finite_ && signs.are_finite();
    if (!result.finite_) return result;
    for (const Block& block : blocks) {
        result.cell_parts_ += block.cell_parts;
        result.at_border_ += block.at_border;
    }
    std::partial_sum(first.begin(), first.end(), first.begin());
    result.fractions_.resize(first.back());
    result.codes_.resize(first.back());
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        const Block block = std::move(blocks[b]);
        const auto begin = static_cast<std::ptrdiff_t>(first[b * kLeaves]);
        std::copy(block.fractions.begin(), block.fractions.end(), result.fractions_.begin() + begin);
        std::copy(block.codes.begin(), block.codes.end(), result.codes_.begin() + begin);
    });
    for (std::size_t n = 0; n < count; ++n)
        if (first[n] < first[n + 1])
            result.parts_.push_back({leaves.leaf(n).origin(), first[n], first[n + 1]});
    for (std::uint32_t part = 0; part < result.parts_.size(); ++part)
        while (result.part_at_.size() * CrossedEdges::kStep < result.parts_[part].end)
            result.part_at_.push_back(part);
    return result;
}

}  // namespace isotrack
