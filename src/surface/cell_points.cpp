#include "surface/cell_points.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "find_in_blocks.h"

namespace isotrack {
namespace {

constexpr int kBits = 21;  // of a cell's coordinate
constexpr double kHalfRange = 1 << (kBits - 1);
constexpr double kAtNode = 1e-4;    // of an edge
constexpr float kLeastWay = 0.01f;  // of a sum of unit vectors

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
        for (int axis = 0; axis < 3; ++axis) along_[axis] = lattice.linear().col(axis).normalized();
    }
    struct Edge {
        Vec3 low;  // its lower end
        int axis;
        bool upward;  // goes out there
    };
    Edge edge_of(const Surface::Crossing& crossing) const {
        const Vec3 outward = crossing.outward.cast<double>();
        int axis = 0;
        for (int other = 1; other < 3; ++other)
            if (std::abs(along_[other].dot(outward)) > std::abs(along_[axis].dot(outward))) axis = other;
        const Vec3 p = to_lattice_ * crossing.point;
        Vec3 low;
        for (int k = 0; k < 3; ++k) low[k] = whole_below(p[k] + 0.5);
        const bool upward = along_[axis].dot(outward) > 0.0;
        // At a node, which is outside as all are where the value is 0, the edge is the one that goes out to
        // it.
        const bool at_node = std::abs(p[axis] - low[axis]) < kAtNode;
        low[axis] = at_node ? low[axis] - upward : whole_below(p[axis]);
        return {low, axis, upward};
    }

private:
    const Eigen::Affine3d to_lattice_;
    Vec3 along_[3];
};

/// The crossings of a cell. Its corner k is bit 0 of k along the first axis, bit 1 along the second, bit 2
/// along the third.
class Cell {
public:
    void clear() {
        count_ = 0;
        crossed_.fill(-1);
        joins_ = 0;
    }
    void add(int low_corner, int axis, bool upward, const Surface::Crossing& crossing) {
        int& at = crossed_[3 * low_corner + axis];
        if (at >= 0) return;
        at = count_;
        const int high_corner = low_corner | 1 << axis;
        crossings_[count_++] = {crossing.point, crossing.outward, upward ? low_corner : high_corner,
                                upward ? high_corner : low_corner};
    }

    /// More than one for each face come from cells too far out to be told apart.
    void join(const int* corners) {
        if (joins_ < static_cast<int>(joined_.size())) joined_[joins_++] = {corners[0], corners[1]};
    }

    /// Crossings are of one part of the surface when the corners inside at them are joined, and those
    /// outside, too.
    void add_means(std::vector<Surface::Crossing>& means) const {
        const std::array<int, 8> part = joined_corners();
        std::array<bool, 12> done{};
        for (int i = 0; i < count_; ++i) {
            if (done[i]) continue;
            Vec3 sum = Vec3::Zero();
            int members = 0;
            std::array<Eigen::Vector3f, 6> ways;  // always summed in the same order: they stay few
            ways.fill(Eigen::Vector3f::Zero());
            for (int j = i; j < count_; ++j) {
                const auto& [point, outward, inside, outside] = crossings_[j];
                if (part[inside] != part[crossings_[i].inside] ||
                    part[outside] != part[crossings_[i].outside])
                    continue;
                done[j] = true;
                sum += point;
                ++members;
                ways[(inside ^ outside) / 2 + (inside < outside ? 3 : 0)] = outward;
            }
            Eigen::Vector3f way = Eigen::Vector3f::Zero();
            for (const Eigen::Vector3f& w : ways) way += w;
            const bool any = way.squaredNorm() > kLeastWay * kLeastWay;
            means.push_back({sum / members, any ? way.normalized() : crossings_[i].outward});
        }
    }

private:
    /// A number for each corner: the same for those that edges without a crossing join, or a diagonal.
    std::array<int, 8> joined_corners() const {
        std::array<int, 8> part{0, 1, 2, 3, 4, 5, 6, 7};
        for (bool again = true; again;) {
            again = false;
            for (int k = 0; k < 8; ++k)
                for (int axis = 0; axis < 3; ++axis) {
                    const int l = k | 1 << axis;
                    if (l == k || crossed_[3 * k + axis] >= 0 || part[k] == part[l]) continue;
                    part[k] = part[l] = std::min(part[k], part[l]);
                    again = true;
                }
            for (int j = 0; j < joins_; ++j) {
                const auto [k, l] = joined_[j];
                if (part[k] == part[l]) continue;
                part[k] = part[l] = std::min(part[k], part[l]);
                again = true;
            }
        }
        return part;
    }

    struct Crossing {
        Vec3 point;
        Eigen::Vector3f outward;
        int inside, outside;  // corners
    };
    std::array<Crossing, 12> crossings_;
    std::array<int, 24> crossed_;  // by lower corner and axis: which crossing, or -1
    int count_ = 0;
    std::array<std::array<int, 2>, 6> joined_;  // corners, across diagonals
    int joins_ = 0;
};

}  // namespace

CellPoints::CellPoints(const CrossingGrid& crossings, const Eigen::Affine3d& lattice,
                       const std::vector<Surface::Diagonal>& diagonals)
    : crossings_(crossings), lattice_(lattice) {
    const Eigen::Affine3d to_lattice = lattice.inverse();
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

std::vector<Surface::Crossing> CellPoints::around(const std::vector<int>& some) {
    const LatticeEdges edges(lattice_);
    constexpr std::size_t kBlock = 512;
    auto wanted = find_in_blocks<std::uint64_t>(
        some.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<std::uint64_t>& found) {
            found.reserve(4 * (end - begin));
            for (std::size_t i = begin; i < end; ++i) {
                const auto [low, axis, upward] = edges.edge_of(crossings_[some[i]]);
                for (const double u : {0.0, 1.0})
                    for (const double w : {0.0, 1.0}) {
                        Vec3 cell = low;
                        cell[(axis + 1) % 3] -= u;
                        cell[(axis + 2) % 3] -= w;
                        found.push_back(packed(cell));
                    }
            }
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
    fresh.reserve(wanted.size());
    std::set_difference(wanted.begin(), wanted.end(), given_.begin(), given_.end(),
                        std::back_inserter(fresh));
    wanted = std::vector<std::uint64_t>();  // there are many

    constexpr double kRounding = 0.01;
    const Vec3 half = 0.5 * (1.0 + kRounding) * lattice_.linear().cwiseAbs().rowwise().sum();
    // Nearly all cells have one part, which has a place from the start: there are many.
    std::vector<Surface::Crossing> result;
    result.reserve(fresh.size() + fresh.size() / 16);
    result.resize(fresh.size());
    const auto others = find_in_blocks<Surface::Crossing>(
        fresh.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<Surface::Crossing>& found) {
            Cell cell;
            std::vector<Surface::Crossing> means;
            for (std::size_t i = begin; i < end; ++i) {
                const Vec3 origin = unpacked(fresh[i]), middle = lattice_ * (origin.array() + 0.5).matrix();
                cell.clear();
                crossings_.for_each_in(Box(middle - half, middle + half), [&](std::size_t c) {
                    const Surface::Crossing crossing = crossings_[c];
                    const auto [low, axis, upward] = edges.edge_of(crossing);
                    const Vec3 from = low - origin;
                    if (from[axis] != 0.0 || from.minCoeff() < 0.0 || from.maxCoeff() > 1.0) return;
                    const int corner = static_cast<int>(from.x() + 2.0 * from.y() + 4.0 * from.z());
                    cell.add(corner, axis, upward, crossing);
                });
                auto join = std::lower_bound(joins_.begin(), joins_.end(), fresh[i],
                                             [](const Join& j, std::uint64_t c) { return j.cell < c; });
                for (; join != joins_.end() && join->cell == fresh[i]; ++join) cell.join(join->corners);
                means.clear();
                cell.add_means(means);
                result[i].stands_for = 0;  // none
                if (means.empty()) continue;
                result[i] = means.front();
                found.insert(found.end(), means.begin() + 1, means.end());
            }
        });
    result.erase(
        std::remove_if(result.begin(), result.end(), [](const auto& point) { return point.stands_for == 0; }),
        result.end());
    result.insert(result.end(), others.begin(), others.end());
    if (given_.empty()) {
        given_ = std::move(fresh);
    } else {
        const auto before = static_cast<std::ptrdiff_t>(given_.size());
        given_.reserve(given_.size() + fresh.size());
        given_.insert(given_.end(), fresh.begin(), fresh.end());
        std::inplace_merge(given_.begin(), given_.begin() + before, given_.end());
    }
    return result;
}

}  // namespace isotrack
