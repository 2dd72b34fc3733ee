// Which triangles stand around each vertex.
#pragma once

#include <cstddef>
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
};

}  // namespace isotrack
