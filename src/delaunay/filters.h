// The predicates of the DT in floating point, with a bound on the error; what that leaves open goes to the
// exact ones.
#pragma once

#include <cmath>

#include "isotrack/delaunay/predicates.h"

namespace isotrack {

namespace filters {

/// Coordinates between which products of three neither overflow nor lose digits that matter to underflow.
constexpr double kSmallest = 1e-97, kLargest = 1e102;

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
    const bool in_range = largest.minCoeff() > filters::kSmallest && largest.maxCoeff() < filters::kLargest;
    if (in_range && std::abs(det) > bound) return det > 0.0 ? 1 : -1;
    return orientation(p, q, r, s);
}

/// As `in_sphere`, exact, and fast where the points are in general position.
inline bool filtered_in_sphere(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s, const Vec3& v) {
    using Four = Eigen::Array4d;  // one entry for each of p, q, r, s, relative to v
    const auto next = [](const Four& f) { return Four(f[1], f[2], f[3], f[0]); };
    const auto after_next = [](const Four& f) { return Four(f[2], f[3], f[0], f[1]); };
    const Four x = Four(p.x(), q.x(), r.x(), s.x()) - v.x(), y = Four(p.y(), q.y(), r.y(), s.y()) - v.y(),
               z = Four(p.z(), q.z(), r.z(), s.z()) - v.z();
    const Four square = x * x + y * y + z * z;
    const Four beside = x * next(y) - y * next(x), across = x * after_next(y) - y * after_next(x);
    const Four volume = z * next(beside) - next(z) * across + after_next(z) * beside;
    const Four term = square * next(volume);
    const double det = (term[0] - term[1]) + (term[2] - term[3]), largest = square.maxCoeff();
    const double bound = filters::kInSphere * 4.62 * largest * largest * std::sqrt(largest);
    const bool in_range = largest > filters::kSmallest && largest < filters::kLargest;  // of the squares
    if (in_range && std::abs(det) > bound) return det > 0.0;
    return in_sphere(p, q, r, s, v);
}

}  // namespace isotrack
