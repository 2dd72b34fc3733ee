// A motion that takes one frame's particles to the next frame's surface.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Where the particles come to on `surface` from a guess (a finite place for each, within a few resolutions
/// of it) when what is next to each other along `ring` moves as rigidly together as it can: an embedded
/// deformation [Sumner et al. 2007], a rotation and a translation for pieces of about 50 particles, larger
/// ones where there would be more than 160 pieces, found by point-to-plane steps on the surface's own values
/// [Chen and Medioni 1992]. Unlike the nearest point of the surface this follows motions along the surface,
/// too, as far as its shape shows them: what slides in itself stays where the guess has it. Near the surface,
/// not on it. nullopt where the guess is on the surface already, or no step comes nearer to it. Uses TBB
/// inside; the same at any thread count.
std::optional<std::vector<Vec3>> register_to(const Surface& surface, const Particles& particles,
                                             const Adjacency& ring, const std::vector<Vec3>& guess);

}  // namespace isotrack
