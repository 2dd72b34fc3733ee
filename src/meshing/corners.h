// Which triangles stand around each vertex.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Those of v are entries first[v] to first[v + 1] - 1, as 3 * triangle + corner, in ascending order.
struct Corners {
    std::vector<int> first, corner;

    Corners(std::size_t vertices, const std::vector<Triangle>& triangles)
        : first(vertices + 1, 0), corner(3 * triangles.size()) {
        for (const Triangle& t : triangles)
            for (const int v : t) ++first[v + 1];
        for (std::size_t v = 0; v < vertices; ++v) first[v + 1] += first[v];
        std::vector<int> end(first.begin(), first.end() - 1);
        for (std::size_t t = 0; t < triangles.size(); ++t)
            for (int k = 0; k < 3; ++k) corner[end[triangles[t][k]]++] = static_cast<int>(3 * t) + k;
    }

    /// The third vertex of the triangle with the edge from v to w, and that triangle; -1 without one.
    std::pair<int, int> beyond(int v, int w, const std::vector<Triangle>& triangles) const {
        for (int e = first[v]; e < first[v + 1]; ++e) {
            const int t = corner[e] / 3, k = corner[e] % 3;
            if (triangles[t][(k + 1) % 3] == w) return {triangles[t][(k + 2) % 3], t};
        }
        return {-1, -1};
    }
};

}  // namespace isotrack
