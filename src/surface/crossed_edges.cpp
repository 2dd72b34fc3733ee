#include "surface/crossed_edges.h"

#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

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

constexpr std::size_t kNone = ~std::size_t{0};

/// The edges of a cube, where the surface may be a flat sheet.
struct FlatCube {
    int count[6] = {};  // of edges in each direction
    // Of them all the lowest and the highest, as the surface faces there, and its corners: the farthest along
    // the diagonals of the two axes that it is nearest to.
    double low = kFar, high = -kFar;
    double corner[4] = {-kFar, -kFar, -kFar, -kFar};
    std::size_t at_corner[4] = {kNone, kNone, kNone, kNone};
    bool flat = false;

    static constexpr double kFar = std::numeric_limits<double>::infinity();
    static int direction(const CrossedEdge& edge) { return 2 * edge.axis + edge.outward; }
    int size() const { return std::accumulate(count, count + 6, 0); }
    /// The sum of the directions: the normal of the surface.
    Vec3 way() const { return Vec3(count[1] - count[0], count[3] - count[2], count[5] - count[4]); }
    bool goes_one_way() const {
        return (count[0] == 0 || count[1] == 0) && (count[2] == 0 || count[3] == 0) &&
               (count[4] == 0 || count[5] == 0);
    }
    /// All edges are counted by now.
    void take_place(std::size_t number, const CrossedEdge& edge) {
        const Vec3 p = edge.index(), n = way();
        const double height = n.dot(p);
        low = std::min(low, height);
        high = std::max(high, height);
        int axis = 0;
        n.cwiseAbs().maxCoeff(&axis);
        const double u = p[(axis + 1) % 3], v = p[(axis + 2) % 3];
        const double along[4] = {u + v, u - v, -u - v, v - u};
        for (int k = 0; k < 4; ++k) {
            if (!(along[k] > corner[k])) continue;
            corner[k] = along[k];
            at_corner[k] = number;
        }
    }
    /// It is flat if it goes one way between two planes that are close together, and is no part of a drop.
    void judge(int wide) {
        constexpr double kThickness = 0.16, kLeastSpread = 0.5;  // of the cube's edge
        flat = goes_one_way() && high - low <= kThickness * wide * way().norm() &&
               std::max(corner[0] + corner[2], corner[1] + corner[3]) >= kLeastSpread * wide;
    }
    void choose(std::vector<StandIn>& found) const {
        if (!flat) return;
        std::array<std::size_t, 4> some{at_corner[0], at_corner[1], at_corner[2], at_corner[3]};
        std::sort(some.begin(), some.end());
        const auto end = std::unique(some.begin(), some.end());
        const int chosen = static_cast<int>(end - some.begin());
        for (int k = 0; k < chosen; ++k) found.push_back({some[k], (size() + k) / chosen, true});
    }
};

/// The edges of a cube of a leaf, whatever they are like.
struct AnyCube {
    int count[3] = {};                                                 // of edges along each axis
    std::size_t some[6] = {kNone, kNone, kNone, kNone, kNone, kNone};  // the last of each direction

    void take(std::size_t number, const CrossedEdge& edge) {
        ++count[edge.axis];
        some[FlatCube::direction(edge)] = number;
    }
    void choose(std::vector<StandIn>& found) const {
        const auto axis = std::max_element(count, count + 3) - count;
        const int size = count[0] + count[1] + count[2];
        const std::size_t in = some[2 * axis], out = some[2 * axis + 1];
        const int of_in = in == kNone ? 0 : out == kNone ? size : size / 2;
        if (in != kNone) found.push_back({in, of_in, false});
        if (out != kNone) found.push_back({out, size - of_in, false});
    }
};

/// The parts of the leaves in each cube of `wide` voxels, leaf by leaf where that is no larger than one.
class PartsInCubes {
public:
    PartsInCubes(const std::vector<CrossedEdges::Part>& parts, int wide) {
        if (wide <= kDim) {
            for (std::size_t n = 0; n < parts.size(); ++n) order_.emplace_back(parts[n].origin, n);
        } else {
            for (std::size_t n = 0; n < parts.size(); ++n)
                order_.emplace_back(parts[n].origin & ~(wide - 1), n);
            tbb::parallel_sort(order_.begin(), order_.end());
        }
        for (std::size_t i = 0; i < order_.size(); ++i)
            if (i == 0 || order_[i].first != order_[i - 1].first) first_.push_back(i);
        first_.push_back(order_.size());
    }
    std::size_t size() const { return first_.size() - 1; }
    /// Calls `visit` with the number of each part of a cube.
    template <typename Visit>
    void for_each_in(std::size_t cube, const Visit& visit) const {
        for (std::size_t i = first_[cube]; i < first_[cube + 1]; ++i) visit(order_[i].second);
    }

private:
    std::vector<std::pair<Coord, std::size_t>> order_;  // lowest corner of the cube, part
    std::vector<std::size_t> first_;                    // of each cube, and the end
};

}  // namespace

std::vector<StandIn> thin_out(const CrossedEdges& crossed, int cube, int wide) {
    const auto cubes_of_leaf = [](int size) {
        return static_cast<std::size_t>(size < kDim ? std::pow(kDim / size, 3) : 1);
    };
    const PartsInCubes parts(crossed.parts, wide);
    const auto find = [&](std::size_t begin, std::size_t end, std::vector<StandIn>& found) {
        std::vector<FlatCube> wide_cubes(cubes_of_leaf(wide));
        std::vector<AnyCube> cubes(cubes_of_leaf(cube));
        for (std::size_t n = begin; n < end; ++n) {
            const auto for_each_edge = [&](const CrossedEdges::Part& part, const auto& visit) {
                for (std::size_t e = part.begin; e < part.end; ++e) {
                    const Coord in_leaf = crossed.edges[e].from - part.origin;
                    visit(e, in_leaf, wide_cubes[wide < kDim ? number_of(in_leaf, wide) : 0]);
                }
            };
            std::fill(wide_cubes.begin(), wide_cubes.end(), FlatCube());
            parts.for_each_in(n, [&](std::size_t part) {
                for_each_edge(crossed.parts[part], [&](std::size_t e, const Coord&, FlatCube& around) {
                    ++around.count[FlatCube::direction(crossed.edges[e])];
                });
            });
            parts.for_each_in(n, [&](std::size_t part) {
                for_each_edge(crossed.parts[part], [&](std::size_t e, const Coord&, FlatCube& around) {
                    if (around.goes_one_way()) around.take_place(e, crossed.edges[e]);
                });
            });
            for (FlatCube& c : wide_cubes) c.judge(wide);
            parts.for_each_in(n, [&](std::size_t part) {
                bool any_other = false;
                for_each_edge(crossed.parts[part],
                              [&](std::size_t e, const Coord& in_leaf, const FlatCube& around) {
                                  if (around.flat) return;
                                  if (!any_other) std::fill(cubes.begin(), cubes.end(), AnyCube());
                                  any_other = true;
                                  cubes[number_of(in_leaf, cube)].take(e, crossed.edges[e]);
                              });
                if (any_other)
                    for (const AnyCube& c : cubes) c.choose(found);
            });
            for (const FlatCube& c : wide_cubes) c.choose(found);
        }
    };
    return find_in_blocks<StandIn>(parts.size(), kLeavesPerBlock, find);
}

namespace {

/// Whether a leaf comes before another in the tree, by their origins: node by node from the root.
bool comes_before(const Coord& a, const Coord& b) {
    constexpr int kLog2Above[] = {12, 7, 0};  // of the edges of the root's children, of theirs, of a voxel
    for (const int shift : kLog2Above)
        if (const Coord x = a >> shift, y = b >> shift; x != y) return x < y;
    return false;
}

}  // namespace

std::vector<std::size_t> edges_near(const CrossedEdges& crossed, const std::vector<Vec3>& places,
                                    double reach, int cube) {
    const int across = kDim / cube;
    const auto is_before = [](const Coord& a, const Coord& b) { return comes_before(a, b); };
    std::map<Coord, std::vector<char>, decltype(is_before)> wanted(is_before);  // of each leaf, its cubes
    auto at = wanted.end();                                                     // the leaf met last
    for (const Vec3& place : places) {
        const Eigen::Array3i low = ((place.array() - reach) / cube).floor().cast<int>(),
                             high = ((place.array() + reach) / cube).floor().cast<int>();
        for (int x = low.x(); x <= high.x(); ++x)
            for (int y = low.y(); y <= high.y(); ++y)
                for (int z = low.z(); z <= high.z(); ++z) {
                    const Coord node(x * cube, y * cube, z * cube), origin = node & ~(kDim - 1);
                    if (at == wanted.end() || at->first != origin)
                        at = wanted.try_emplace(origin, across * across * across, 0).first;
                    at->second[number_of(node - origin, cube)] = 1;
                }
    }
    std::vector<std::size_t> found;
    for (const auto& [origin, cubes] : wanted) {
        const auto part = std::lower_bound(
            crossed.parts.begin(), crossed.parts.end(), origin,
            [](const CrossedEdges::Part& p, const Coord& there) { return comes_before(p.origin, there); });
        if (part == crossed.parts.end() || part->origin != origin) continue;
        for (std::size_t e = part->begin; e < part->end; ++e)
            if (cubes[number_of(crossed.edges[e].from - origin, cube)]) found.push_back(e);
    }
    return found;
}

}  // namespace isotrack
