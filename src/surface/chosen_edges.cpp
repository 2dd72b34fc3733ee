#include "surface/chosen_edges.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "find_in_blocks.h"

namespace isotrack {

using openvdb::Coord;

namespace {

constexpr int kDim = openvdb::FloatTree::LeafNodeType::DIM;

/// Which of the cubes of a leaf holds a node, or is next to one that is just below the leaf.
std::size_t number_of(const Coord& in_leaf, int cube) {
    const int across = kDim / cube;
    const auto at = [&](int axis) { return std::max(in_leaf[axis], 0) / cube; };
    return static_cast<std::size_t>((at(0) * across + at(1)) * across + at(2));
}

constexpr std::size_t kNone = ~std::size_t{0};

/// The edges of a cube, where the surface may be a flat sheet.
struct FlatCube {
    int count[6] = {};           // of edges in each direction
    bool goes_one_way = false;   // along each axis
    Vec3 normal = Vec3::Zero();  // the sum of the directions
    int axis = 0;                // that it is nearest to
    // Of them all the lowest and the highest, as the surface faces there, and its corners: the farthest along
    // the diagonals of the two axes that it is nearest to.
    double low = kFar, high = -kFar;
    double corner[4] = {-kFar, -kFar, -kFar, -kFar};
    std::size_t at_corner[4] = {kNone, kNone, kNone, kNone};
    bool flat = false;

    static constexpr double kFar = std::numeric_limits<double>::infinity();
    static int direction(const CrossedEdge& edge) { return 2 * edge.axis + edge.outward; }
    int size() const { return std::accumulate(count, count + 6, 0); }
    /// All edges are counted by now.
    void take_counts() {
        goes_one_way = (count[0] == 0 || count[1] == 0) && (count[2] == 0 || count[3] == 0) &&
                       (count[4] == 0 || count[5] == 0);
        normal = Vec3(count[1] - count[0], count[3] - count[2], count[5] - count[4]);
        normal.cwiseAbs().maxCoeff(&axis);
    }
    void take_place(std::size_t number, const CrossedEdge& edge) {
        const Vec3 p = edge.index();
        const double height = normal.dot(p);
        low = std::min(low, height);
        high = std::max(high, height);
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
        flat = goes_one_way && high - low <= kThickness * wide * normal.norm() &&
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
    const PartsInCubes parts(crossed.parts(), wide);
    const auto find = [&](std::size_t begin, std::size_t end, std::vector<StandIn>& found) {
        std::vector<FlatCube> wide_cubes(cubes_of_leaf(wide));
        std::vector<AnyCube> cubes(cubes_of_leaf(cube));
        for (std::size_t n = begin; n < end; ++n) {
            const auto for_each_edge = [&](const CrossedEdges::Part& part, const auto& visit) {
                crossed.for_each_of(part, [&](std::size_t e, const CrossedEdge& edge) {
                    const Coord in_leaf = edge.from - part.origin;
                    visit(e, edge, in_leaf, wide_cubes[wide < kDim ? number_of(in_leaf, wide) : 0]);
                });
            };
            std::fill(wide_cubes.begin(), wide_cubes.end(), FlatCube());
            parts.for_each_in(n, [&](std::size_t part) {
                for_each_edge(crossed.parts()[part],
                              [&](std::size_t, const CrossedEdge& edge, const Coord&, FlatCube& around) {
                                  ++around.count[FlatCube::direction(edge)];
                              });
            });
            for (FlatCube& c : wide_cubes) c.take_counts();
            parts.for_each_in(n, [&](std::size_t part) {
                for_each_edge(crossed.parts()[part],
                              [&](std::size_t e, const CrossedEdge& edge, const Coord&, FlatCube& around) {
                                  if (around.goes_one_way) around.take_place(e, edge);
                              });
            });
            for (FlatCube& c : wide_cubes) c.judge(wide);
            parts.for_each_in(n, [&](std::size_t part) {
                bool any_other = false;
                for_each_edge(crossed.parts()[part], [&](std::size_t e, const CrossedEdge& edge,
                                                         const Coord& in_leaf, const FlatCube& around) {
                    if (around.flat) return;
                    if (!any_other) std::fill(cubes.begin(), cubes.end(), AnyCube());
                    any_other = true;
                    cubes[number_of(in_leaf, cube)].take(e, edge);
                });
                if (any_other)
                    for (const AnyCube& c : cubes) c.choose(found);
            });
            for (const FlatCube& c : wide_cubes) c.choose(found);
        }
    };
    constexpr std::size_t kCubesPerBlock = 64;
    return find_in_blocks<StandIn>(parts.size(), kCubesPerBlock, find);
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
    for (const auto& leaf : wanted) {
        const Coord& origin = leaf.first;
        const std::vector<char>& is_wanted = leaf.second;
        const auto part = std::lower_bound(
            crossed.parts().begin(), crossed.parts().end(), origin,
            [](const CrossedEdges::Part& p, const Coord& there) { return comes_before(p.origin, there); });
        if (part == crossed.parts().end() || part->origin != origin) continue;
        crossed.for_each_of(*part, [&](std::size_t e, const CrossedEdge& edge) {
            if (is_wanted[number_of(edge.from - origin, cube)]) found.push_back(e);
        });
    }
    return found;
}

}  // namespace isotrack
