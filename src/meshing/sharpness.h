// How sharp a triangle is, without trigonometry.
#pragma once

#include <algorithm>

#include "isotrack/types.h"

namespace isotrack {

/// Of triangles with this smallest angle.
constexpr double kSharpnessAt31Degrees = 1.6643, kSharpnessAt30Degrees = 1.7320508075688772,
                 kSharpnessAt22Degrees = 2.4751, kSharpnessAt18Degrees = 3.0777;

/// Cotangent of the smallest angle: 1.73 at 30 degrees, infinite without area.
inline double sharpness(const Vec3& p, const Vec3& q, const Vec3& r) {
    const Vec3 u = q - p, v = r - q, w = p - r;
    return std::max({-u.dot(w), -v.dot(u), -w.dot(v)}) / u.cross(v).norm();
}

/// Whether a triangle's sharpness is larger than `sharpness` (> 0): as asking for it, but faster; NaN is.
inline bool is_sharper(double sharpness, const Vec3& p, const Vec3& q, const Vec3& r) {
    const Vec3 u = q - p, v = r - q, w = p - r;
    const double most = std::max({-u.dot(w), -v.dot(u), -w.dot(v)});
    return !(most * most <= sharpness * sharpness * u.cross(v).squaredNorm());
}

}  // namespace isotrack
