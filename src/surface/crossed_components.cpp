#include "surface/crossed_components.h"

#include <openvdb/tree/LeafManager.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bitset>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

#include "surface/ambiguous_faces.h"
#include "surface/leaf_sides.h"

namespace isotrack {
namespace {

using openvdb::Coord;
using Leaf = openvdb::FloatTree::LeafNodeType;
using Bits = std::uint64_t;

constexpr int kDim = LeafSides::kDim;
constexpr std::size_t kLog2Dim = Leaf::LOG2DIM;
constexpr std::size_t kBlocks = 128;  // a thread's at least

int count_of(Bits bits) {
    return static_cast<int>(std::bitset<64>(bits).count());
}

/// Which nodes of layer x of a block are inside, one step further along some axes.
Bits inside_at(const LeafSides& sides, int x, const Coord& step) {
    return sides.word(x + step.x(), step.y(), step.z());
}

Coord unit(int axis) {
    Coord result(0);
    result[axis] = 1;
    return result;
}

/// As many nodes as a leaf has, where there is one or a part of a tile; and the crossed edges with their
/// lower ends there.
class Block {
public:
    /// Of a tile those edges alone whose upper ends are in a leaf.
    Block(const Coord& origin, const LeafSides& sides, TreeReader& reader) : origin_(origin) {
        const bool is_tile = !reader.probeConstLeaf(origin);
        for (int axis = 0; axis < 3; ++axis) {
            Coord beyond = origin;
            beyond[axis] += kDim;
            const bool are_seen = !is_tile || reader.probeConstLeaf(beyond);
            for (int x = 0; x < kDim; ++x) {
                const Bits crossed = inside_at(sides, x, Coord(0)) ^ inside_at(sides, x, unit(axis));
                crossed_[axis][x] = are_seen ? crossed : 0;
                first_[axis][x] = count_;
                count_ += count_of(crossed_[axis][x]);
            }
        }
    }
    const Coord& origin() const { return origin_; }
    /// From now on they are numbered from `first` on; returns where the next block's begin.
    int number_from(int first) {
        for (auto& of_axis : first_)
            for (int& of_layer : of_axis) of_layer += first;
        return first + count_;
    }
    /// The number of the edge along an axis from the node at bit 8 y + z of layer x; -1 if it is none of
    /// them.
    int number(int axis, int x, int bit) const {
        const Bits crossed = crossed_[axis][x];
        return (crossed >> bit & 1) != 0 ? first_[axis][x] + count_of(crossed & ((Bits{1} << bit) - 1)) : -1;
    }
    /// Calls `visit(number, from, axis)` for each edge, from its lower end.
    template <typename Visit>
    void for_each_edge(const Visit& visit) const {
        for (int axis = 0; axis < 3; ++axis)
            for (int x = 0; x < kDim; ++x) {
                int number = first_[axis][x];
                for_each_bit(crossed_[axis][x], [&](int bit) {
                    visit(number++, origin_.offsetBy(x, bit / kDim, bit % kDim), axis);
                });
            }
    }

private:
    Coord origin_;
    Bits crossed_[3][kDim];
    int first_[3][kDim], count_ = 0;
};

/// All that have nodes on both sides, one beyond the upper ends included.
std::vector<Block> mixed_blocks(const openvdb::FloatTree& tree) {
    const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(tree);
    struct Found {
        std::vector<Block> blocks;
        std::vector<Coord> tiles;
    };
    tbb::enumerable_thread_specific<Found> found_by_threads;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, leaves.leafCount(), kBlocks), [&](const auto& range) {
            Found& found = found_by_threads.local();
            TreeReader reader(tree);
            LeafSigns signs;
            for (std::size_t n = range.begin(); n < range.end(); ++n) {
                const Leaf& leaf = leaves.leaf(n);
                const LeafSides sides(leaf, reader, signs);
                if (sides.are_mixed()) found.blocks.emplace_back(leaf.origin(), sides, reader);
                for_each_tile_below(leaf, sides, reader, [&](const Coord& tile, const Coord&, bool) {
                    found.tiles.push_back(tile);
                });
            }
        });
    std::vector<Block> result;
    std::vector<Coord> tiles;
    for (const Found& found : found_by_threads) {
        result.insert(result.end(), found.blocks.begin(), found.blocks.end());
        tiles.insert(tiles.end(), found.tiles.begin(), found.tiles.end());
    }
    std::sort(tiles.begin(), tiles.end());
    tiles.erase(std::unique(tiles.begin(), tiles.end()), tiles.end());
    TreeReader reader(tree);
    LeafSigns signs;
    for (const Coord& tile : tiles)
        result.emplace_back(tile, LeafSides(tile, nullptr, reader, signs), reader);
    return result;
}

/// Which edges hang together, found by several threads at once.
class SharedSets {
public:
    explicit SharedSets(std::size_t count) : parent_(count) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 16384), [&](const auto& range) {
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                parent_[i].store(static_cast<int>(i), std::memory_order_relaxed);
        });
    }
    /// Returns whether they were apart.
    bool join(int i, int j) {
        while (true) {
            i = least(i), j = least(j);
            if (i == j) return false;
            int greater = std::max(i, j);
            if (parent_[greater].compare_exchange_strong(greater, std::min(i, j), std::memory_order_relaxed))
                return true;
        }
    }

    /// The number that a set goes by.
    int least(int i) {
        for (int up = parent(i); up != i; up = parent(i)) {
            parent_[i].store(parent(up), std::memory_order_relaxed);  // another of its set, whoever looks
            i = up;
        }
        return i;
    }

private:
    int parent(int i) const { return parent_[i].load(std::memory_order_relaxed); }

    std::vector<std::atomic<int>> parent_;
};

/// Joins the crossed edges of the faces that have their lowest node in a block.
class FaceJoiner {
public:
    /// `above`: the next blocks along each axis, null where none of the edges that are seen begins.
    FaceJoiner(const Block& block, const Block* const (&above)[3], const LeafSides& sides, TreeReader& reader,
               SharedSets& sets)
        : block_(block), above_(above), sides_(sides), reader_(reader), sets_(sets) {}

    /// Returns how many sets became one with another.
    std::size_t join_all() {
        for (int first = 0; first < 3; ++first)
            for (int second = first + 1; second < 3; ++second)
                for (int x = 0; x < kDim; ++x) join_across(x, first, second);
        return joined_;
    }

private:
    /// In faces along two axes from layer x.
    void join_across(int x, int first, int second) {
        const Coord u = unit(first), w = unit(second);
        const Bits low = inside_at(sides_, x, Coord(0)), at_u = inside_at(sides_, x, u),
                   at_w = inside_at(sides_, x, w), at_both = inside_at(sides_, x, u + w);
        // The face's edges along the first axis and along the second, from the lowest node and from the next.
        const Bits along_first[2] = {low ^ at_u, at_w ^ at_both},
                   along_second[2] = {low ^ at_w, at_u ^ at_both};
        if ((along_first[0] | along_first[1] | along_second[0] | along_second[1]) == 0) return;
        const auto first_edge = [&](int side, int bit) { return edge(first, second, side, x, bit); };
        const auto second_edge = [&](int side, int bit) { return edge(second, first, side, x, bit); };
        const Bits ambiguous = along_first[0] & along_first[1] & along_second[0];  // the fourth, too
        for_each_bit(along_first[0] & along_first[1] & ~ambiguous,
                     [&](int bit) { join(first_edge(0, bit), first_edge(1, bit)); });
        for_each_bit(along_second[0] & along_second[1] & ~ambiguous,
                     [&](int bit) { join(second_edge(0, bit), second_edge(1, bit)); });
        for (const int f : {0, 1})
            for (const int s : {0, 1})
                for_each_bit(along_first[f] & along_second[s] & ~ambiguous,
                             [&](int bit) { join(first_edge(f, bit), second_edge(s, bit)); });
        for_each_bit(ambiguous, [&](int bit) {
            // Either the inside nodes are cut off from each other, or the outside ones are.
            const Coord node = block_.origin().offsetBy(x, bit / kDim, bit % kDim),
                        out = unit(3 - first - second);
            const bool is_low_inside = (low >> bit & 1u) != 0;
            const auto inside = [&](int side, int a, int b) {
                Coord at = side == 0 ? node - out : node + out;
                if (is_low_inside ? a : 1 - a) at += u;
                if (b) at += w;
                return reader_.getValue(at) < 0.0f;
            };
            const int cut_off =
                is_low_inside != joins_diagonal(inside) ? 0 : 1;  // the lowest node, or those next
            join(first_edge(0, bit), second_edge(cut_off, bit));
            join(first_edge(1, bit), second_edge(1 - cut_off, bit));
        });
    }

    /// The number of an edge of the face from a node: along `axis`, on one of its sides across it. -1 for one
    /// between two tiles.
    int edge(int axis, int across, int side, int x, int bit) const {
        int at[3] = {x, bit / kDim, bit % kDim};
        const Block* block = &block_;
        if (side == 1 && ++at[across] == kDim) {
            at[across] = 0;
            block = above_[across];
        }
        return block ? block->number(axis, at[0], kDim * at[1] + at[2]) : -1;
    }
    void join(int e, int other) {
        if (e >= 0 && other >= 0) joined_ += sets_.join(e, other);
    }

    const Block& block_;
    const Block* const (&above_)[3];
    const LeafSides& sides_;
    TreeReader& reader_;
    SharedSets& sets_;
    std::size_t joined_ = 0;
};

/// All crossed edges of a tree, put together.
class CrossedComponents {
public:
    explicit CrossedComponents(const openvdb::FloatTree& tree)
        : blocks_(mixed_blocks(tree)), edges_(number(blocks_)), sets_(edges_) {
        // By their places in blocks: low bits count in the hash.
        std::unordered_map<Coord, const Block*, std::hash<Coord>> at;
        at.reserve(blocks_.size());
        for (const Block& block : blocks_) at.emplace(block.origin() >> kLog2Dim, &block);
        const std::size_t joined = tbb::parallel_reduce(
            range(), std::size_t{0},
            [&](const auto& some, std::size_t joined_before) {
                TreeReader reader(tree);
                LeafSigns signs;
                for (std::size_t b = some.begin(); b < some.end(); ++b) {
                    const Coord& origin = blocks_[b].origin();
                    const Block* above[3];
                    for (int axis = 0; axis < 3; ++axis) {
                        const auto next = at.find((origin >> kLog2Dim) + unit(axis));
                        above[axis] = next == at.end() ? nullptr : next->second;
                    }
                    const LeafSides sides(origin, reader.probeConstLeaf(origin), reader, signs);
                    joined_before += FaceJoiner(blocks_[b], above, sides, reader, sets_).join_all();
                }
                return joined_before;
            },
            std::plus<std::size_t>());
        count_ = edges_ - joined;
    }
    std::size_t count() const { return count_; }

    /// Calls `visit(component, from, axis)` for each edge of some blocks, from its lower end; a component
    /// goes by one of the numbers below that of all edges.
    template <typename Visit>
    void for_each_edge(const tbb::blocked_range<std::size_t>& blocks, const Visit& visit) {
        for (std::size_t b = blocks.begin(); b < blocks.end(); ++b)
            blocks_[b].for_each_edge(
                [&](int edge, const Coord& from, int axis) { visit(sets_.least(edge), from, axis); });
    }
    /// All blocks.
    tbb::blocked_range<std::size_t> range() const { return {0, blocks_.size(), kBlocks}; }

private:
    /// Returns how many edges there are.
    static std::size_t number(std::vector<Block>& blocks) {
        int edges = 0;
        for (Block& block : blocks) edges = block.number_from(edges);
        return static_cast<std::size_t>(edges);
    }

    std::vector<Block> blocks_;
    std::size_t edges_;
    SharedSets sets_;
    std::size_t count_ = 0;
};

}  // namespace

std::size_t count_components(const openvdb::FloatTree& tree) {
    return CrossedComponents(tree).count();
}

std::vector<Box> boxes_of_components(const openvdb::FloatTree& tree, const AffineMap& map) {
    CrossedComponents components(tree);
    using Boxes = std::unordered_map<int, Box>;
    tbb::enumerable_thread_specific<Boxes> of_threads;
    tbb::parallel_for(components.range(), [&](const auto& some) {
        Boxes& boxes = of_threads.local();
        TreeReader reader(tree);
        components.for_each_edge(some, [&](int component, const Coord& from, int axis) {
            const double low = reader.getValue(from), high = reader.getValue(from + unit(axis));
            const Vec3 way = std::clamp(low / (low - high), 0.0, 1.0) * Vec3::Unit(axis);
            boxes[component].extend(map.to_world(Vec3(from.x(), from.y(), from.z()) + way));
        });
    });
    Boxes all;
    for (const Boxes& boxes : of_threads)
        for (const auto& [component, box] : boxes) all[component].extend(box);
    std::vector<Box> result;
    for (const auto& [component, box] : all) result.push_back(box);
    const auto corners = [](const Box& box) {
        return std::array{box.min().x(), box.min().y(), box.min().z(),
                          box.max().x(), box.max().y(), box.max().z()};
    };
    std::sort(result.begin(), result.end(),
              [&](const Box& a, const Box& b) { return corners(a) < corners(b); });
    return result;
}

}  // namespace isotrack
