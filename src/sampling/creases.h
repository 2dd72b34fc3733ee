// Creases of the surface: where particles on them are, triangles have their edges along them.
#pragma once

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// What holds a particle back.
struct Crease {
    enum class Kind { None, Line, Corner };
    Kind kind = Kind::None;
    Vec3 along = Vec3::Zero();  ///< Of a line: unit, of either sign.
};

/// Moves particle i to the crease or the corner that passes within 0.4 of its spacing: to the nearest point
/// that the tangent planes around it have in common, by least squares [Kobbelt et al. 2001; Ju et al. 2002],
/// projected by O1. The planes are those of eight points at that distance, but one `resolution` at least
/// (world units). Two eigenvalues of the mean of n n^T over them tell a crease from what is smooth, the third
/// tells its corners; what bends more tightly than one and a half of its spacings counts as a crease, too.
/// Nothing moves where there is none, where none of the `neighbours` faces another way, where one of them is
/// within 0.8 of the spacing of the place already (unless the particle is there), or where values are
/// unknown. Writes the particle alone, reads the neighbours.
Crease pull_to_crease(Particles& particles, Adjacency::Range neighbours, int i, double resolution,
                      Surface::Probe& probe);

/// Brings everybody back to the crease or corner that is within a tenth of the spacing, as after a motion
/// that was not quite right; those that are on it stay, and whoever would come within 0.3 of the
/// spacing of a neighbour.
void return_to_creases(Particles& particles, const Adjacency& adjacency, const Surface& surface);

}  // namespace isotrack
