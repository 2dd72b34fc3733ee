// From the surface of one frame to that of the next.
#pragma once

#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"
#include "isotrack/tracking/tracker.h"
#include "tracking/registration.h"

namespace isotrack {

/// Brings the particles to the new surface, whose crossings may be asked for, and sets their velocities.
/// Returns a flag per particle: 0 for one that finds no way there or would change sides, and stays where it
/// was.
///
/// A velocity field may be in a unit nobody knows and a motion may have turned round, so three guesses of
/// where the particles go compete: `motion` if there is one, the last displacement, standing still. The one
/// that lands nearest to the surface wins, by its median over the particles; an earlier one wins unless a
/// later one is clearly better. From there what is next to each other along `ring` moves as rigidly together
/// as it can, see `register_to`; when `motion` has won, where that misses the surface. What is on the surface
/// and would hardly move stays.
std::vector<char> carry(Particles& particles, const Adjacency& ring, const Surface& surface,
                        const Crossings& crossings, const Tracker::Motion& motion);

}  // namespace isotrack
