// The centre of the sphere through four points.
#pragma once

#include <algorithm>
#include <cmath>

#include "isotrack/types.h"

namespace isotrack {

/// Relative to the first point, from the three edge vectors to the others; false when the cell is so flat
/// that rounding would decide.
inline bool circumcentre(const Vec3& a, const Vec3& b, const Vec3& c, Vec3& centre) {
    constexpr double kFlatness = 1e-10;  // of the cube of the cell's size
    const Vec3 bc = b.cross(c);
    const double volume6 = a.dot(bc);
    const double size = std::max({a.squaredNorm(), b.squaredNorm(), c.squaredNorm()});
    if (!(std::abs(volume6) > kFlatness * size * std::sqrt(size))) return false;
    centre = (a.squaredNorm() * bc + b.squaredNorm() * c.cross(a) + c.squaredNorm() * a.cross(b)) /
             (2.0 * volume6);
    return true;
}

}  // namespace isotrack
