// The wanted spacing of the particles.
#pragma once

#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// World units and radians; all > 0.
struct SizingLimits {
    double tolerance;           ///< Of values at the mesh: less than of distances where the slope is.
    double angle;               ///< Largest angle between the normals of neighbours.
    double min_edge, max_edge;  ///< The spacing stays between these.
    double detail;              ///< What is smaller need not be seen: the surface's resolution, or more.
    double angle_floor =
        0.0;  ///< The angle alone asks for no spacing below this: at a sharp edge it would never be met.
    /// Whether the mean square counts beside the number of particles. Then a smaller error is aimed at where
    /// particles are farther apart than the lower quartile h_0, by (h_0 / h)^(1/2); and, when more than a
    /// tenth of them have hardly any error, being there only because the spacing must not jump from small to
    /// large, everywhere: down to 0.35 where about half of them have none.
    bool mean_square_counts = false;
    double thinning = 0.5;  ///< Least factor of 1/h^2 in one update: near 1 a population thins out slowly.
};

/// What the mesh of the last build says about each particle. One entry per particle.
struct SizingEvidence {
    std::vector<double>
        error;  ///< Largest distance between the triangles around it and the surface; negative: not known.
    std::vector<double> thickness;  ///< To the nearest Delaunay neighbour of opposite normal (the paper's
                                    ///< th); infinite: none.
};

/// A first guess from the curvature of the surface at a point: the edge of an equilateral triangle whose
/// error is the tolerance.
double spacing_from_curvature(Surface::Probe& probe, const Vec3& p, const Vec3& n, double resolution,
                              const SizingLimits& limits);

/// Of the particles whose error is known, the share of those that have more than hardly any, 0.15 of what is
/// aimed at: nearly all on smooth surfaces, few where flat faces meet. 1 when none is known.
double share_with_error(const SizingEvidence& evidence, const SizingLimits& limits);

/// The paper's k_nd: sqrt(max over neighbours on the same side of (1 - n_i . n_j) / r_ij^2), 1 / world units.
double normal_deviation(const Particles& particles, const Adjacency& adjacency, std::size_t i);

/// Feeds the measured error back: 1/h^2 becomes error / (share of the tolerance aimed at), at least
/// `thinning` and at most 2, over the wanted spacing times the actual one, since the error is that of the
/// actual and a population with a dead zone lags behind what is wanted; then the angle, the thickness and the
/// limits bound it, and the gradation h_i <= h_j + 0.25 r_ij smooths it. The stretch becomes (kappa_1 /
/// kappa_2)^(1/2), at most 1.4, from the curvature of the normals around the particle.
void update_spacing(Particles& particles, const Adjacency& adjacency, const SizingEvidence& evidence,
                    const SizingLimits& limits);

}  // namespace isotrack
