// Triangles found by their corners.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// The same triangle from its least corner on.
inline Triangle from_least_corner(Triangle t) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
}

/// Oriented triangles over so many vertices. Read-only, so threads may share it.
class TriangleIndex {
public:
    TriangleIndex() = default;
    TriangleIndex(std::size_t vertices, const std::vector<Triangle>& triangles)
        : first_(vertices + 1, 0), triangles_(triangles.size()) {
        for (const Triangle& t : triangles) ++first_[*std::min_element(t.begin(), t.end()) + 1];
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        std::vector<int> next(first_.begin(), first_.end() - 1);
        for (const Triangle& corners : triangles) {
            const Triangle t = from_least_corner(corners);
            triangles_[next[t[0]]++] = t;
        }
        for (std::size_t v = 0; v < vertices; ++v)
            std::sort(triangles_.begin() + first_[v], triangles_.begin() + first_[v + 1]);
    }
    /// From their least corners on, ascending.
    const std::vector<Triangle>& triangles() const { return triangles_; }
    /// The number among `triangles()` of the one with these corners in this order, or -1.
    int find(const Triangle& corners) const {
        const Triangle t = from_least_corner(corners);
        if (t[0] < 0 || static_cast<std::size_t>(t[0]) + 1 >= first_.size()) return -1;
        for (int i = first_[t[0]]; i < first_[t[0] + 1]; ++i)
            if (triangles_[i] == t) return i;
        return -1;
    }

private:
    std::vector<int> first_;  // of those from a vertex on
    std::vector<Triangle> triangles_;
};

}  // namespace isotrack
