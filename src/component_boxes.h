// The connected components of a mesh, by their extent.
#pragma once

#include <cstddef>
#include <vector>

#include "disjoint_sets.h"
#include "isotrack/types.h"

namespace isotrack {

/// The box of the vertices of each component of some polygons, in the order of their least vertices.
/// `points` and `polygons` are vectors of anything with three coordinates and with `corners` indices.
template <int corners, typename Points, typename Polygons>
std::vector<Box> component_boxes(const Points& points, const Polygons& polygons) {
    DisjointSets vertices(points.size());
    for (const auto& polygon : polygons)
        for (int k = 1; k < corners; ++k)
            vertices.join(static_cast<int>(polygon[0]), static_cast<int>(polygon[k]));
    std::vector<int> box_of(points.size(), -1);
    for (const auto& polygon : polygons) box_of[vertices.least(static_cast<int>(polygon[0]))] = 0;
    std::vector<Box> result;
    for (int v = 0; v < static_cast<int>(points.size()); ++v) {
        int& box = box_of[vertices.least(v)];
        if (box < 0) continue;  // of no polygon
        if (vertices.least(v) == v) {
            box = static_cast<int>(result.size());
            result.emplace_back();
        }
        result[box].extend(Vec3(points[v][0], points[v][1], points[v][2]));
    }
    return result;
}

}  // namespace isotrack
