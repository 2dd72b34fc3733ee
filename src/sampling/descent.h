// One step of the paper's coordinate descent, shared by the parallel sweeps and the paper's own queue.
#pragma once

#include <limits>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"
#include "sampling/metric.h"

namespace isotrack {

constexpr double kRestThreshold =
    0.05;  ///< Of sigma: the paper's THRESHOLD. A particle that moved less is at rest.

struct DescentStep {
    double moved = 0.0;  ///< Distance moved over sigma, both in the metric.
    double sigma = std::numeric_limits<double>::infinity();  ///< r_0 / sqrt(2) in the metric, before the
                                                             ///< step; infinite without neighbours.
};

/// The paper's algorithm 2 for particle i: a Levenberg-Marquardt step on the Gaussian energy of those
/// `neighbours` that face the same way and are within 2 sigma, in the tangent plane, in the metric d^2 =
/// (k_i^2 + k_j^2) / 2 |r|^2 with k = 1 / spacing, stretched as the particles say (`metrics`: of each);
/// projected by O1; undone unless the energy falls. `lambda` is the particle's damping, kept from step to
/// step. `along`, a unit vector: the only way to go, as on a crease; none when it is more
/// than 60 degrees off the tangent plane.
DescentStep descend(Particles& particles, const std::vector<Metric>& metrics, Adjacency::Range neighbours,
                    int i, double& lambda, Surface::Probe& probe, const Vec3* along = nullptr);

}  // namespace isotrack
