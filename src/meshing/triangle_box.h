// The box of a triangle.
#pragma once

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

inline Box box_of(const std::vector<Vec3>& points, const Triangle& t) {
    const auto& [i, j, k] = t;
    return Box(points[i].cwiseMin(points[j]).cwiseMin(points[k]),
               points[i].cwiseMax(points[j]).cwiseMax(points[k]));
}

}  // namespace isotrack
