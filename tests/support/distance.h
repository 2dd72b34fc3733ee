// Distances by brute force.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "isotrack/types.h"

namespace isotrack::support {

/// From p to triangle abc, by walking the segments and the plane, nothing clever.
inline double distance_to_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto to_segment = [&](const Vec3& u, const Vec3& v) {
        const double s = std::clamp((p - u).dot(v - u) / (v - u).squaredNorm(), 0.0, 1.0);
        return (u + s * (v - u) - p).norm();
    };
    double least = std::min({to_segment(a, b), to_segment(b, c), to_segment(c, a)});
    const Vec3 n = (b - a).cross(c - a).normalized();
    const Vec3 q = p - n.dot(p - a) * n;
    const bool within = n.dot((b - a).cross(q - a)) >= 0 && n.dot((c - b).cross(q - b)) >= 0 &&
                        n.dot((a - c).cross(q - c)) >= 0;
    return within ? std::min(least, std::abs(n.dot(p - a))) : least;
}

/// From p to the nearest of all triangles; infinite without any.
inline double distance_to_mesh(const Vec3& p, const TriangleMesh& mesh) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [a, b, c] : mesh.triangles)
        least = std::min(least, distance_to_triangle(p, mesh.points[a], mesh.points[b], mesh.points[c]));
    return least;
}

}  // namespace isotrack::support
