// A motion that takes one frame's particles to the next frame's surface.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Where the particles come to from `start` (a place for each, within a few resolutions of `surface`) when
/// what is next to each other along `ring` moves as rigidly together as it can: an embedded deformation
/// [Sumner et al. 2007], a rotation and a translation for every few dozen particles, found by point-to-plane
/// steps on the surface's own values [Chen and Medioni 1992]. Unlike the nearest point of the surface this
/// follows motions along the surface, too, as far as its shape shows them: what slides in itself stays where
/// it was. Near the surface, not on it. nullopt where `start` is on the surface already.
std::optional<std::vector<Vec3>> register_to(const Surface& surface, const Particles& particles,
                                             const Adjacency& ring, const std::vector<Vec3>& guess);

}  // namespace isotrack
