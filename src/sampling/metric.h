// Lengths in units of the spacing, longer across a particle's stretch than along it.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "isotrack/sampling/particles.h"
#include "parallel_for_each.h"

namespace isotrack {

/// The squared length r^T M r of an edge r as scale |r|^2 - (w . r)^2.
struct Metric {
    double scale;
    Vec3 w;

    double square(const Vec3& r) const {
        const double along = w.dot(r);
        return scale * r.squaredNorm() - along * along;
    }
    /// M r.
    Vec3 apply(const Vec3& r) const { return scale * r - w.dot(r) * w; }
};

/// That of a particle with this spacing h and stretch u: with s = 1 + |u|^2, lengths along u count
/// 1 / (sqrt(s) h), those across it sqrt(s) / h.
inline Metric metric_of(double spacing, const Vec3& stretch) {
    const double s = 1.0 + stretch.squaredNorm(), k = 1.0 / spacing;
    return {s * k * k, k * std::sqrt(1.0 + 1.0 / s) * stretch};
}

inline Metric metric_of(const Particles& particles, std::size_t i) {
    return metric_of(particles.spacing[i], particles.stretch[i]);
}

/// Of each particle.
inline std::vector<Metric> metrics_of(const Particles& particles) {
    constexpr std::size_t kGrain = 1024;
    std::vector<Metric> result(particles.size());
    parallel_for_each(result.size(), kGrain, [&](std::size_t i) { result[i] = metric_of(particles, i); });
    return result;
}

/// The squared length of the edge between two particles, in the mean of their metrics; infinite where they
/// face away from each other.
inline double square_between(const Particles& particles, const std::vector<Metric>& metrics, int i, int j) {
    if (!(particles.normal[i].dot(particles.normal[j]) > 0.0)) return std::numeric_limits<double>::infinity();
    const Vec3 r = particles.position[j] - particles.position[i];
    return 0.5 * (metrics[i].square(r) + metrics[j].square(r));
}

}  // namespace isotrack
