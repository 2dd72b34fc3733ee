// The predicates of the DT in floating point, with a bound on the error; what that leaves open goes to the
// exact ones.
#pragma once

#include <algorithm>
#include <cmath>

#include "isotrack/delaunay/predicates.h"

namespace isotrack {

namespace filters {

/// A bound that is itself right needs products far from underflow.
constexpr double kSmallest = 1e-280;

/// Errors of the determinants below, over the sum of the sizes of their terms: half an ulp (2^-53) for every
/// operation on the way from coordinates to sum, 8 for orientation and 16 for in_sphere; the rest is for the
/// rounding of the bound itself.
constexpr double kOrientation = 10 * 0x1p-53, kInSphere = 20 * 0x1p-53;

}  // namespace filters

/// As `orientation`, exact, and fast where the points are in general position.
inline int filtered_orientation(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
    const Vec3 a = q - p, b = r - p, c = s - p;
    const double xy = a.x() * b.y() - a.y() * b.x(), yz = a.y() * b.z() - a.z() * b.y(),
                 zx = a.z() * b.x() - a.x() * b.z();
    const double det = yz * c.x() + zx * c.y() + xy * c.z();
    const Vec3 largest = a.cwiseAbs().cwiseMax(b.cwiseAbs()).cwiseMax(c.cwiseAbs());
    const double bound = filters::kOrientation * 6.0 * (largest.x() * largest.y() * largest.z());
    if (bound > filters::kSmallest && std::abs(det) > bound) return det > 0.0 ? 1 : -1;
    return orientation(p, q, r, s);
}

/// As `in_sphere`, exact, and fast where the points are in general position.
inline bool filtered_in_sphere(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s, const Vec3& v) {
    const Vec3 a = p - v, b = q - v, c = r - v, d = s - v;
    const double ab = a.x() * b.y() - a.y() * b.x(), bc = b.x() * c.y() - b.y() * c.x(),
                 cd = c.x() * d.y() - c.y() * d.x(), da = d.x() * a.y() - d.y() * a.x(),
                 ac = a.x() * c.y() - a.y() * c.x(), bd = b.x() * d.y() - b.y() * d.x();
    const double abc = a.z() * bc - b.z() * ac + c.z() * ab, bcd = b.z() * cd - c.z() * bd + d.z() * bc,
                 cda = c.z() * da + d.z() * ac + a.z() * cd, dab = d.z() * ab + a.z() * bd + b.z() * da;
    const double aa = a.squaredNorm(), bb = b.squaredNorm(), cc = c.squaredNorm(), dd = d.squaredNorm();
    const double det = (aa * bcd - bb * cda) + (cc * dab - dd * abc);
    const double largest = std::max(std::max(aa, bb), std::max(cc, dd));
    const double bound = filters::kInSphere * 4.62 * largest * largest * std::sqrt(largest);
    if (bound > filters::kSmallest && std::abs(det) > bound) return det > 0.0;
    return in_sphere(p, q, r, s, v);
}

}  // namespace isotrack
