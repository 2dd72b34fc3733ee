#include "surface/crossed_components.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <vector>

#include "surface/ambiguous_faces.h"
#include "surface/node_values.h"

namespace isotrack {
namespace {

using openvdb::Coord;

/// The numbers of crossed edges by their lower end and axis.
class EdgeNumbers {
public:
    explicit EdgeNumbers(const UnsetVector<CrossedEdge>& edges) : edges_(edges), places_(size_for(edges)) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, edges.size(), 4096), [&](const auto& range) {
            for (std::size_t e = range.begin(); e < range.end(); ++e) {
                std::size_t at = place_of(edges[e].from, edges[e].axis);
                for (std::uint32_t none = 0; !places_[at].compare_exchange_strong(
                         none, static_cast<std::uint32_t>(e + 1), std::memory_order_relaxed);
                     none = 0)
                    at = (at + 1) & (places_.size() - 1);
            }
        });
    }

    /// -1 where there is none, as between two tiles.
    int at(const Coord& from, int axis) const {
        for (std::size_t at = place_of(from, axis);; at = (at + 1) & (places_.size() - 1)) {
            const std::uint32_t number = places_[at].load(std::memory_order_relaxed);
            if (number == 0) return -1;
            const CrossedEdge& edge = edges_[number - 1];
            if (edge.axis == axis && edge.from == from) return static_cast<int>(number - 1);
        }
    }

private:
    static std::size_t size_for(const UnsetVector<CrossedEdge>& edges) {
        std::size_t size = 64;
        while (size < 2 * edges.size()) size *= 2;
        return size;
    }
    std::size_t place_of(const Coord& from, int axis) const {
        const auto part = [](int i, std::uint64_t factor) { return static_cast<std::uint32_t>(i) * factor; };
        const std::uint64_t mixed = part(from.x(), 0x9e3779b97f4a7c15) ^ part(from.y(), 0xc2b2ae3d27d4eb4f) ^
                                    part(from.z(), 0x165667b19e3779f9) ^ part(axis, 0x27d4eb2f165667c5);
        return static_cast<std::size_t>(mixed >> 20) & (places_.size() - 1);
    }

    const UnsetVector<CrossedEdge>& edges_;
    std::vector<std::atomic<std::uint32_t>> places_;  // one more than the number; 0: free
};

/// A face of the lattice by its lowest node and its two axes, `first` below `second`.
struct Face {
    Coord low;
    int first, second;

    Coord node(int u, int w, int out = 0) const {
        Coord result = low;
        result[first] += u;
        result[second] += w;
        result[3 - first - second] += out;
        return result;
    }
};

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

private:
    int least(int i) {
        for (int up = parent(i); up != i; up = parent(i)) {
            parent_[i].store(parent(up), std::memory_order_relaxed);  // another of its set, whoever looks
            i = up;
        }
        return i;
    }
    int parent(int i) const { return parent_[i].load(std::memory_order_relaxed); }

    std::vector<std::atomic<int>> parent_;
};

/// Joins the crossed edges of faces, each face once: from the edge that comes first in it.
class FaceJoiner {
public:
    FaceJoiner(const EdgeNumbers& numbers, const openvdb::FloatTree& tree, SharedSets& sets)
        : numbers_(numbers), nodes_(tree), sets_(sets) {}

    void join_around(int number, const CrossedEdge& edge) {
        around_ = edge.from.offsetBy(-1);
        nodes_.block(around_, values_);
        for (int other = 0; other < 3; ++other) {
            if (other == edge.axis) continue;
            if (other < edge.axis) {
                join_along_second(number, edge.outward, {edge.from, other, edge.axis});
                continue;
            }
            Coord below = edge.from;
            --below[other];
            join_along_first(number, edge.outward, {edge.from, edge.axis, other});
            join_from_far_side(number, edge.outward, {below, edge.axis, other});
        }
    }
    /// So many sets became one with another.
    std::size_t joined() const { return joined_; }

private:
    bool inside(const Coord& node) const {
        const Coord at = node - around_;
        return values_[at.x()][at.y()][at.z()] < 0.0f;
    }
    int along_first(const Face& f, int w) const { return numbers_.at(f.node(0, w), f.first); }
    int along_second(const Face& f, int u) const { return numbers_.at(f.node(u, 0), f.second); }
    void join(int e, int other) {
        if (other >= 0 && e >= 0) joined_ += sets_.join(e, other);
    }

    /// From the edge along the first axis at the lowest node, which is inside or not.
    void join_along_first(int e, bool low, const Face& f) {
        const bool w = inside(f.node(0, 1)), high = inside(f.node(1, 1));
        if (w == high) {
            join(e, along_second(f, low == w ? 1 : 0));
        } else if (low == w) {
            join(e, along_first(f, 1));
        } else {
            // Either the inside nodes are cut off from each other, or the outside ones are.
            const bool joined = joins_diagonal([&](int side, int a, int b) {
                return inside(f.node(low ? a : 1 - a, b, side == 0 ? -1 : 1));
            });
            const bool low_is_cut_off = low != joined;
            join(e, along_second(f, low_is_cut_off ? 0 : 1));
            join(along_first(f, 1), along_second(f, low_is_cut_off ? 1 : 0));
        }
    }
    /// From the one along the first axis on the other side, where the former is not crossed.
    void join_from_far_side(int e, bool w, const Face& f) {
        const bool low = inside(f.low);
        if (low == inside(f.node(1, 0))) join(e, along_second(f, low == w ? 1 : 0));
    }
    /// From the one along the second axis at the lowest node, where none of these are.
    void join_along_second(int e, bool low, const Face& f) {
        if (inside(f.node(1, 0)) == low && inside(f.node(1, 1)) != low) join(e, along_second(f, 1));
    }

    const EdgeNumbers& numbers_;
    NodeValues nodes_;
    Coord around_;           // the lowest of the nodes around the edge
    float values_[4][4][4];  // at them
    SharedSets& sets_;
    std::size_t joined_ = 0;
};

}  // namespace

std::size_t count_components(const CrossedEdges& crossed, const openvdb::FloatTree& tree) {
    const UnsetVector<CrossedEdge>& edges = crossed.edges;
    const EdgeNumbers numbers(edges);
    SharedSets sets(edges.size());
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, edges.size(), 8192), edges.size(),
        [&](const auto& range, std::size_t count) {
            FaceJoiner joiner(numbers, tree, sets);
            for (std::size_t e = range.begin(); e < range.end(); ++e)
                joiner.join_around(static_cast<int>(e), edges[e]);
            return count - joiner.joined();
        },
        [&](std::size_t a, std::size_t b) { return a + b - edges.size(); });
}

}  // namespace isotrack
