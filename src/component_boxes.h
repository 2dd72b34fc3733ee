// The connected components of a mesh, by their extent.
#pragma once

#include <cstddef>
#include <vector>

#include "disjoint_sets.h"
#include "isotrack/types.h"

namespace isotrack {

/// Of the vertices of each connected component of some triangles, in the order of their least vertices.
struct ComponentBoxes {
    std::vector<Box> boxes;
    std::vector<int> of_vertex;  ///< Which box it is in; -1: it is of no triangle.
};

inline ComponentBoxes component_boxes(const std::vector<Vec3>& points,
                                      const std::vector<Triangle>& triangles) {
    DisjointSets vertices(points.size());
    std::vector<char> is_used(points.size(), 0);
    for (const Triangle& t : triangles)
        for (const int v : t) {
            vertices.join(t[0], v);
            is_used[v] = 1;
        }
    ComponentBoxes result{{}, std::vector<int>(points.size(), -1)};
    for (int v = 0; v < static_cast<int>(points.size()); ++v) {
        if (!is_used[v]) continue;
        const int least = vertices.least(v);  // which was met before, if it is another
        if (least == v) {
            result.of_vertex[v] = static_cast<int>(result.boxes.size());
            result.boxes.emplace_back();
        }
        result.of_vertex[v] = result.of_vertex[least];
        result.boxes[result.of_vertex[v]].extend(points[v]);
    }
    return result;
}

}  // namespace isotrack
