// What a triangle of a mesh must not be.
#pragma once

#include <algorithm>

#include "isotrack/sampling/particles.h"
#include "meshing/sharpness.h"
#include "tracking/facet_error.h"

namespace isotrack {

constexpr double kSuspect = 0.6;     // of the tolerance: above it a triangle's largest error is searched for
constexpr double kCertified = 0.97;  // of the tolerance: samples at other places find it kept, too
constexpr double kChangedShare = 0.96;  // of the tolerance: for triangles that come for others that keep it
// The mean slope of a level set made of a mesh is 0.976: values over it still keep the tolerance. Where the
// slope is less values are held to less.
constexpr double kFullSlope = 0.975;

inline bool is_too_far(const FacetError& error, double tolerance) {
    return error.largest > kCertified * tolerance;
}
inline bool is_turned(const FacetError& error) {
    return error.turned_deg > kMostTurnedDeg;
}

/// Whether the angles of a triangle between particles matter: on smooth surface, and not tiny.
inline bool angles_matter(const Particles& particles, const Triangle& corner, double detail) {
    constexpr double kSmooth = 0.45;     // cosine between the normals of the corners
    constexpr double kAnglesFrom = 1.0;  // details: longest edge
    double longest = 0.0;
    for (int e = 0; e < 3; ++e) {
        const int a = corner[e], b = corner[(e + 1) % 3];
        if (!(particles.normal[a].dot(particles.normal[b]) > kSmooth)) return false;
        longest = std::max(longest, (particles.position[a] - particles.position[b]).norm());
    }
    return longest > kAnglesFrom * detail;
}

/// Whether its particles make it too sharp, where that matters.
inline bool is_needle(const Particles& particles, const Triangle& corner, double detail) {
    const auto& at = particles.position;
    return is_sharper(kSharpnessAt22Degrees, at[corner[0]], at[corner[1]], at[corner[2]]) &&
           angles_matter(particles, corner, detail);
}

}  // namespace isotrack
