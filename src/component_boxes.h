// The connected components of a mesh, by their extent.
#pragma once

#include <cstddef>
#include <vector>

#include "disjoint_sets.h"
#include "isotrack/types.h"

namespace isotrack {

/// The box of the vertices of each component of some triangles, in the order of their least vertices.
inline std::vector<Box> component_boxes(const std::vector<Vec3>& points,
                                        const std::vector<Triangle>& triangles) {
    DisjointSets vertices(points.size());
    for (const Triangle& t : triangles)
        for (const int v : {t[1], t[2]}) vertices.join(t[0], v);
    std::vector<int> box_of(points.size(), -1);
    for (const Triangle& t : triangles) box_of[vertices.least(t[0])] = 0;
    std::vector<Box> result;
    for (int v = 0; v < static_cast<int>(points.size()); ++v) {
        int& box = box_of[vertices.least(v)];
        if (box < 0) continue;  // of no triangle
        if (vertices.least(v) == v) {
            box = static_cast<int>(result.size());
            result.emplace_back();
        }
        result[box].extend(points[v]);
    }
    return result;
}

}  // namespace isotrack
