// Particles to try things on.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/shapes.h"

namespace isotrack::support {

inline SizingLimits limits_of(double edge) {
    SizingLimits limits{};
    limits.tolerance = 0.1 * edge;
    limits.angle = 0.7;
    limits.min_edge = limits.max_edge = edge;
    return limits;
}

inline Particles random_on_unit_sphere(std::size_t count, double spacing) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    Particles particles;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 n = Vec3(normal(random), normal(random), normal(random)).normalized();
        particles.add(n, n, spacing, static_cast<Id>(i));
    }
    return particles;
}

inline Adjacency adjacency_of(const Particles& particles) {
    return vertex_adjacency(tetrahedralise(particles.position), particles.size());
}

inline double nearest_distance(const Particles& particles, std::size_t i) {
    double least = 1e300;
    for (std::size_t j = 0; j < particles.size(); ++j)
        if (j != i) least = std::min(least, (particles.position[j] - particles.position[i]).norm());
    return least;
}

/// Along the tube of a torus around the third axis.
inline Vec3 along_tube(const Vec3& p) {
    return Vec3(-p.y(), p.x(), 0.0).normalized();
}

/// Particles all over the unit sphere, well spread.
inline Particles settled_on_unit_sphere(std::size_t count, double spacing) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles = random_on_unit_sphere(count, spacing);
    for (int sweep = 0; sweep < 20; ++sweep) relax(particles, adjacency_of(particles), *sphere, 1);
    return particles;
}

}  // namespace isotrack::support
