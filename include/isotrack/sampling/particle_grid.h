// Which particles are near a place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// The points of a list that grows, in the cells of an unbounded regular grid. Visits in order of cells, then
/// of the list.
class PointGrid {
public:
    /// Holds none of `points` at first. The list must outlive it; what is in the grid may not change.
    /// `cell_size`: world units, > 0; best near the usual query radius. `expected`: so many points at least.
    explicit PointGrid(const std::vector<Vec3>& points, double cell_size, std::size_t expected = 0)
        : points_(points), cell_size_(cell_size), buckets_(kFewest) {
        entries_.reserve(expected);
    }

    /// Takes the points that the list has got since.
    void take_new() {
        while (entries_.size() < points_.size()) {
            if (entries_.size() == buckets_.size()) {
                buckets_.assign(2 * buckets_.size(), {});
                for (std::size_t e = 0; e < entries_.size(); ++e) append(static_cast<int>(e));
            }
            entries_.push_back({key(cell(points_[entries_.size()])), kNone});
            append(static_cast<int>(entries_.size()) - 1);
        }
    }

    /// Calls visit(index, squared distance) for every point within `radius` of p, which is less than 500
    /// cells.
    template <typename Visit>
    void for_each_within(const Vec3& p, double radius, const Visit& visit) const {
        const Cell low = cell(p - Vec3::Constant(radius)), high = cell(p + Vec3::Constant(radius));
        for (std::int64_t x = low[0]; x <= high[0]; ++x)
            for (std::int64_t y = low[1]; y <= high[1]; ++y)
                for (std::int64_t z = low[2]; z <= high[2]; ++z) {
                    const std::uint32_t wanted = key({x, y, z});
                    for (int e = buckets_[bucket(wanted)].first; e != kNone; e = entries_[e].next) {
                        if (entries_[e].key != wanted) continue;
                        const double d2 = (points_[e] - p).squaredNorm();
                        if (d2 <= radius * radius) visit(e, d2);
                    }
                }
    }

private:
    using Cell = Eigen::Array<std::int64_t, 3, 1>;
    static constexpr int kNone = -1;
    static constexpr std::size_t kFewest = 64;  // a power of two
    struct Entry {
        std::uint32_t key;  // of its cell
        int next;           // the next entry in its bucket
    };
    struct Bucket {
        int first = kNone, last = kNone;
    };
    void append(int e) {
        entries_[e].next = kNone;
        Bucket& of = buckets_[bucket(entries_[e].key)];
        (of.first == kNone ? of.first : entries_[of.last].next) = e;
        of.last = e;
    }
    std::size_t bucket(std::uint32_t key) const {
        return (key * std::uint64_t{0x9e3779b97f4a7c15u} >> 32) & (buckets_.size() - 1);
    }
    Cell cell(const Vec3& p) const { return (p / cell_size_).array().floor().cast<std::int64_t>(); }
    static std::uint32_t key(const Cell& c) {
        // Distinct for cells less than 2^10 apart; farther ones share a bucket, where the distance tells them
        // apart.
        return ((static_cast<std::uint32_t>(c[0]) & 0x7ff) << 21) |
               ((static_cast<std::uint32_t>(c[1]) & 0x7ff) << 10) |
               (static_cast<std::uint32_t>(c[2]) & 0x3ff);
    }

    const std::vector<Vec3>& points_;
    double cell_size_;
    std::vector<Entry> entries_;  // of the points, in their order
    std::vector<Bucket> buckets_;
};

}  // namespace isotrack
