// Which particles are near a place.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Points in the cells of an unbounded regular grid. Grows by insertion; visits in order of cells, then of insertion.
class PointGrid {
public:
    /// `cell_size`: world units, > 0; best near the usual query radius.
    explicit PointGrid(double cell_size) : cell_size_(cell_size) {}

    void insert(const Vec3& p, int index) { cells_[key(cell(p))].push_back({p, index}); }

    /// Calls visit(index, squared distance) for every point within `radius` of p.
    template <typename Visit>
    void for_each_within(const Vec3& p, double radius, const Visit& visit) const {
        const Cell low = cell(p - Vec3::Constant(radius)), high = cell(p + Vec3::Constant(radius));
        for (std::int64_t x = low[0]; x <= high[0]; ++x)
            for (std::int64_t y = low[1]; y <= high[1]; ++y)
                for (std::int64_t z = low[2]; z <= high[2]; ++z) {
                    const auto it = cells_.find(key({x, y, z}));
                    if (it == cells_.end()) continue;
                    for (const Entry& e : it->second) {
                        const double d2 = (e.point - p).squaredNorm();
                        if (d2 <= radius * radius) visit(e.index, d2);
                    }
                }
    }

private:
    using Cell = Eigen::Array<std::int64_t, 3, 1>;
    struct Entry {
        Vec3 point;
        int index;
    };
    Cell cell(const Vec3& p) const { return (p / cell_size_).array().floor().cast<std::int64_t>(); }
    static std::uint64_t key(const Cell& c) {
        // Distinct for cells less than 2^21 apart; farther ones share a bucket, where the distance tells them apart.
        return ((static_cast<std::uint64_t>(c[0]) & 0x1fffff) << 42) | ((static_cast<std::uint64_t>(c[1]) & 0x1fffff) << 21) |
               (static_cast<std::uint64_t>(c[2]) & 0x1fffff);
    }

    double cell_size_;
    std::unordered_map<std::uint64_t, std::vector<Entry>> cells_;
};

}  // namespace isotrack
