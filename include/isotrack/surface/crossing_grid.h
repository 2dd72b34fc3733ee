// The lattice crossings of a surface, found by place.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "isotrack/surface/surface.h"

namespace isotrack {

/// Crossings in columns along the third axis, sorted within each by where they are on it. The order depends
/// on the crossings alone. Read-only, so threads may share it.
class CrossingGrid {
public:
    /// Those of `surface.crossings(apart)`.
    explicit CrossingGrid(const Surface& surface, double apart = 0.0)
        : CrossingGrid(surface.crossings(apart), std::max(surface.resolution(), apart)) {}
    /// `spacing` of the crossings, world units.
    CrossingGrid(std::vector<Surface::Crossing> crossings, double spacing);

    const std::vector<Surface::Crossing>& crossings() const { return crossings_; }
    double spacing() const { return spacing_; }

    /// Calls `visit` with the index of every crossing in `box`; of those in columns that are set only, if
    /// given.
    template <typename Visit>
    void for_each_in(const Box& box, const Visit& visit, const std::vector<char>* columns = nullptr) const {
        int from[2], to[2];
        for (int axis = 0; axis < 2; ++axis) {
            from[axis] = column(axis, box.min()[axis]);
            to[axis] = column(axis, box.max()[axis]);
        }
        if (crossings_.empty()) return;
        for (int x = from[0]; x <= to[0]; ++x)
            for (int y = from[1]; y <= to[1]; ++y) {
                const std::size_t at = static_cast<std::size_t>(x) * count_[1] + y;
                if (columns && !(*columns)[at]) continue;
                const auto end = crossings_.begin() + static_cast<std::ptrdiff_t>(first_[at + 1]);
                auto c = std::lower_bound(
                    crossings_.begin() + static_cast<std::ptrdiff_t>(first_[at]), end, box.min().z(),
                    [](const Surface::Crossing& crossing, double z) { return crossing.point.z() < z; });
                for (; c != end && c->point.z() <= box.max().z(); ++c)
                    if (c->point.x() >= box.min().x() && c->point.x() <= box.max().x() &&
                        c->point.y() >= box.min().y() && c->point.y() <= box.max().y())
                        visit(static_cast<std::size_t>(c - crossings_.begin()));
            }
    }

    /// Whether the box is over a column that is set.
    bool meets(const Box& box, const std::vector<char>& columns) const {
        if (crossings_.empty()) return false;
        const int to = column(1, box.max()[1]);
        for (int x = column(0, box.min()[0]); x <= column(0, box.max()[0]); ++x)
            for (int y = column(1, box.min()[1]); y <= to; ++y)
                if (columns[static_cast<std::size_t>(x) * count_[1] + y]) return true;
        return false;
    }

    /// Flags per column: it holds a crossing that is wanted. `wanted`: a flag per crossing.
    std::vector<char> columns_of(const std::vector<char>& wanted) const;

private:
    int column(int axis, double place) const {
        return static_cast<int>(
            std::clamp((place - origin_[axis]) / width_, 0.0, static_cast<double>(count_[axis] - 1)));
    }

    std::vector<Surface::Crossing> crossings_;
    std::vector<std::size_t> first_;  // of each column, and the end
    Vec3 origin_ = Vec3::Zero();
    double spacing_, width_;  // of the columns: wider where there would be many more than crossings
    int count_[2] = {1, 1};
};

}  // namespace isotrack
