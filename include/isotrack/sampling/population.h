// Births and deaths, with a dead zone between them so that the population does not flicker.
#pragma once

#include <memory>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particle_grid.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Thresholds relative to the spacing, in the metric of the particles' stretch. In a hexagonal packing the
/// nearest neighbour is at 1, the circumradius is 0.577. A death leaves an empty circle of the radius of the
/// old distances, below `sparse`; a birth has its nearest neighbours at that radius, above `crowded`.
struct PopulationBand {
    double crowded = 0.65;  ///< Delete below this distance to the nearest neighbour.
    double sparse = 0.85;   ///< Insert where a triangle's circumradius is above this.
};

/// Flags for `Particles::retain`: drops particles whose nearest neighbour facing the same way is too near,
/// most crowded first, no two neighbours at once.
std::vector<char> uncrowded(const Particles& particles, const Adjacency& adjacency,
                            const PopulationBand& band = {});

/// Adds a particle at the projected circumcentre of triangles (of particle indices) that are too large,
/// largest first, none beside another, unless a particle up to two steps of `ring` from a corner is within
/// 0.8 of the spacing of that place: the triangles need not be those of a DT. Returns the triangle of each
/// that was added; they take its mean spacing.
std::vector<Triangle> fill_sparse(Particles& particles, const std::vector<Triangle>& triangles,
                                  const Adjacency& ring, const Surface& surface, Id& next_id,
                                  const PopulationBand& band = {});

/// A place where the mesh fails, and the spacing that would mend it.
struct Shortage {
    Vec3 place;
    double spacing;      ///< World units.
    double least = 0.0;  ///< Particles around it get no denser than this.
};

/// Adds particles where the mesh fails, call by call. Between calls no particle may be moved or removed.
class Densifier {
public:
    /// `detail`: what is smaller need not be looked at; the surface's resolution, or more where the tolerance
    /// is wide. There will be no more than `most` particles, and no new one's spacing will be outside
    /// `min_spacing` to `max_spacing`. All references must outlive it.
    Densifier(Particles& particles, const Surface& surface, double detail, double min_spacing,
              double max_spacing, std::size_t most, Id& next_id);

    /// Adds particles at the projections of `shortages` (where there is none, on the surface within half a
    /// resolution, if that is there), in their order, at places that floats can hold: at least 0.7 of the
    /// wanted spacing, or of that of the nearest particle, from those that face the same way. A particle that
    /// was there before and is nearer is surrounded instead: its spacing becomes 0.6 of the smaller of its
    /// own and the wanted one, down to `min_spacing` and `least`, and six more are added around it at that
    /// distance, so that repeated calls get denser; where there is no place for any, as on what is smaller
    /// than the ring, that becomes smaller still. Where there is room for more than the wanted spacing a
    /// particle takes the distance to the nearest for its own (up to ten times the wanted one and eight
    /// details), and no other of the same call is added within 0.7 of that: it is seen first what the one
    /// has mended. Returns how many were added: 0 means that nothing more can be done.
    std::size_t add(const std::vector<Shortage>& shortages);

private:
    /// Adds a particle at the projection of `place` and returns -1, or the one that is already there; neither
    /// where one of this call mends enough (-2).
    int add_or_nearest(const Vec3& place, double h);

    Particles& particles_;
    const Surface& surface_;
    double detail_, min_spacing_, max_spacing_;
    std::size_t most_;
    Id& next_id_;
    std::unique_ptr<Surface::Probe> probe_;
    PointGrid grid_;
    int first_of_call_ = 0;        // of the particles added
    double widest_of_call_ = 0.0;  // of their spacings
};

}  // namespace isotrack
