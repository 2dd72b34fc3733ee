#include "surface/cell_points.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "find_in_blocks.h"
#include "room.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr int kBits = 21;  // of a cell's coordinate
constexpr double kHalfRange = 1 << (kBits - 1);
constexpr double kAtNode = 1e-4;  // of an edge

std::uint64_t packed(const Vec3& cell) {
    std::uint64_t result = 0;
    for (int axis = 0; axis < 3; ++axis)
        result = result << kBits |
                 static_cast<std::uint64_t>(std::clamp(cell[axis] + kHalfRange, 0.0, 2.0 * kHalfRange - 1.0));
    return result;
}

Vec3 unpacked(std::uint64_t cell) {
    constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
    Vec3 result;
    for (int axis = 0; axis < 3; ++axis)
        result[axis] = static_cast<double>(cell >> (2 - axis) * kBits & kMask) - kHalfRange;
    return result;
}

/// The largest whole number that is not above x, as coordinates of cells are; inlined, which std::floor is
/// only for newer processors.
double whole_below(double x) {
    const auto towards_zero = static_cast<double>(static_cast<std::int64_t>(x));
    return towards_zero > x ? towards_zero - 1.0 : towards_zero;
}

/// Lattice crossings in lattice units.
class LatticeEdges {
public:
    explicit LatticeEdges(const Eigen::Affine3d& lattice) : to_lattice_(lattice.inverse()) {
        for (int axis = 0; axis < 3; ++axis)
            along_[axis] = lattice.linear().col(axis).normalized().cast<float>();
    }
    /// Calls `visit(low, axis)` for the edge that a crossing is on, by its lower end. Next to a node, which
    /// may be inside by rounding, that may be one of two.
    template <typename Visit>
    void for_each_edge_of(const Surface::Crossing& crossing, const Visit& visit) const {
        int axis = 0;
        for (int other = 1; other < 3; ++other)
            if (std::abs(along_[other].dot(crossing.outward)) > std::abs(along_[axis].dot(crossing.outward)))
                axis = other;
        const Vec3 p = to_lattice_ * crossing.point;
        Vec3 low;
        for (int k = 0; k < 3; ++k) low[k] = whole_below(p[k] + 0.5);
        if (std::abs(p[axis] - low[axis]) < kAtNode) {
            visit(low, axis);
            low[axis] -= 1.0;
        } else {
            low[axis] = whole_below(p[axis]);
        }
        visit(low, axis);
    }

private:
    const Eigen::Affine3d to_lattice_;
    Eigen::Vector3f along_[3];
};

/// For each corner of a cell a number: the same for those on one side that edges join.
using Parts = std::array<std::uint8_t, 8>;

/// Joins all that have the number of either corner.
void join(Parts& parts, int k, int l) {
    const std::uint8_t low = std::min(parts[k], parts[l]), high = std::max(parts[k], parts[l]);
    std::replace(parts.begin(), parts.end(), high, low);
}

/// By the corners that are inside: bit k for corner k.
const std::array<Parts, 256> kParts = [] {
    std::array<Parts, 256> result{};
    for (unsigned inside = 0; inside < 256; ++inside) {
        std::iota(result[inside].begin(), result[inside].end(), std::uint8_t{0});
        for (int k = 0; k < 8; ++k)
            for (const int step : {1, 2, 4})
                if ((k & step) == 0 && (inside >> k & 1) == (inside >> (k | step) & 1))
                    join(result[inside], k, k | step);
    }
    return result;
}();

/// A cell by the values at its corners.
class Cell {
public:
    explicit Cell(const Surface::Probe::CellValues& values) : values_(values) {
        for (int k = 0; k < 8; ++k) inside_ |= static_cast<unsigned>(values[k] < 0.0) << k;
        parts_ = kParts[inside_];
    }
    void join_corners(int k, int l) { join(parts_, k, l); }

    /// Calls `visit(place, ways)` for each part of the surface: the mean of its crossings, in edges from the
    /// lowest corner on, and the directions they go. They are of one part when the corners inside at them are
    /// joined, and those outside, too.
    template <typename Visit>
    void for_each_mean(const Visit& visit) const {
        struct Group {
            int ends = -1;  // numbers of the corners inside and outside
            int members = 0;
            Vec3 sum = Vec3::Zero();
            PackedCrossings::Ways ways = 0;
        };
        std::array<Group, 12> groups;
        int count = 0;
        for (int axis = 0; axis < 3; ++axis)
            for (int k = 0; k < 8; ++k) {
                const int l = k | 1 << axis;
                const bool goes_up = (inside_ >> k & 1) != 0;
                if (l == k || goes_up == ((inside_ >> l & 1) != 0)) continue;
                const int ends = goes_up ? 8 * parts_[k] + parts_[l] : 8 * parts_[l] + parts_[k];
                int g = 0;
                while (g < count && groups[g].ends != ends) ++g;
                if (g == count) groups[count++].ends = ends;
                Group& group = groups[g];
                ++group.members;
                group.sum += Vec3(k & 1, k >> 1 & 1, k >> 2);
                group.sum[axis] += values_[k] / (values_[k] - values_[l]);
                group.ways |= 1u << (goes_up ? axis : axis + 3);
            }
        for (int g = 0; g < count; ++g) visit(groups[g].sum / groups[g].members, groups[g].ways);
    }

private:
    const Surface::Probe::CellValues& values_;
    unsigned inside_ = 0;  // bit k for corner k
    Parts parts_;
};

}  // namespace

CellPoints::CellPoints(const Surface& surface, const CrossingGrid& crossings,
                       const std::vector<Surface::Diagonal>& diagonals)
    : surface_(surface), crossings_(crossings), lattice_(surface.lattice()) {
    const Eigen::Affine3d to_lattice = lattice_.inverse();
    for (const Surface::Diagonal& d : diagonals) {
        const Vec3 nodes[2] = {(to_lattice * d.from).array().round(), (to_lattice * d.to).array().round()};
        int across = 0;
        while (nodes[0][across] != nodes[1][across]) ++across;
        for (const double step : {0.0, 1.0}) {
            const Vec3 cell = nodes[0].cwiseMin(nodes[1]) - step * Vec3::Unit(across);
            Join join{packed(cell), {}};
            for (int n = 0; n < 2; ++n)
                join.corners[n] = static_cast<int>((nodes[n] - cell).dot(Vec3(1, 2, 4)));
            joins_.push_back(join);
        }
    }
    std::sort(joins_.begin(), joins_.end(), [](const Join& a, const Join& b) { return a.cell < b.cell; });
}

PackedCrossings CellPoints::around(const std::vector<int>& some) {
    const LatticeEdges edges(lattice_);
    constexpr std::size_t kBlock = 512;
    auto wanted = find_in_blocks<std::uint64_t>(
        some.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<std::uint64_t>& found) {
            found.reserve(4 * (end - begin));
            for (std::size_t i = begin; i < end; ++i)
                edges.for_each_edge_of(crossings_[some[i]], [&](const Vec3& low, int axis) {
                    for (const double u : {0.0, 1.0})
                        for (const double w : {0.0, 1.0}) {
                            Vec3 cell = low;
                            cell[(axis + 1) % 3] -= u;
                            cell[(axis + 2) % 3] -= w;
                            found.push_back(packed(cell));
                        }
                });
            // Most are around several crossings of the block.
            std::sort(found.begin(), found.end());
            found.erase(std::unique(found.begin(), found.end()), found.end());
            found.shrink_to_fit();
        });
    if (given_.empty())
        for (const Join& join : joins_) wanted.push_back(join.cell);
    tbb::parallel_sort(wanted.begin(), wanted.end());
    wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
    std::vector<std::uint64_t> fresh;
    reserve_with_slack(fresh, wanted.size());
    std::set_difference(wanted.begin(), wanted.end(), given_.begin(), given_.end(),
                        std::back_inserter(fresh));
    wanted = std::vector<std::uint64_t>();  // there are many

    // Nearly all cells have one part, which has a place from the start: there are many.
    using Entry = PackedCrossings::Entry;
    PackedCrossings result(surface_.bounds().min(), lattice_);
    result.entries.reserve(fresh.size() + fresh.size() / 16);
    result.entries.resize(fresh.size());
    ThreadProbes probes(surface_);
    const auto others = find_in_blocks<Entry>(
        fresh.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<Entry>& found) {
            Surface::Probe& probe = probes.local();
            for (std::size_t i = begin; i < end; ++i) {
                const Vec3 low = unpacked(fresh[i]);
                const Surface::Probe::CellValues values = probe.cell_values(low, lattice_);
                Cell cell(values);
                auto join = std::lower_bound(joins_.begin(), joins_.end(), fresh[i],
                                             [](const Join& j, std::uint64_t c) { return j.cell < c; });
                for (; join != joins_.end() && join->cell == fresh[i]; ++join)
                    cell.join_corners(join->corners[0], join->corners[1]);
                Entry& first = result.entries[i];
                first.ways = PackedCrossings::kNoWay;
                cell.for_each_mean([&](const Vec3& place, PackedCrossings::Ways ways) {
                    const Entry mean = result.packed(lattice_ * (low + place), ways);
                    if (first.ways == PackedCrossings::kNoWay)
                        first = mean;
                    else
                        found.push_back(mean);
                });
            }
        });
    auto& entries = result.entries;
    entries.erase(std::remove_if(entries.begin(), entries.end(),
                                 [](const Entry& entry) { return entry.ways == PackedCrossings::kNoWay; }),
                  entries.end());
    entries.insert(entries.end(), others.begin(), others.end());
    if (given_.empty()) {
        given_ = std::move(fresh);  // later ones are few
    } else {
        const auto before = static_cast<std::ptrdiff_t>(given_.size());
        given_.insert(given_.end(), fresh.begin(), fresh.end());
        std::inplace_merge(given_.begin(), given_.begin() + before, given_.end());
    }
    return result;
}

}  // namespace isotrack
