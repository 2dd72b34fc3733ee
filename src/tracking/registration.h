// A motion that takes one frame's particles to the next frame's surface.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/crossing_grid.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// The crossings of a surface, which may still be in the making: who asks waits for them.
using Crossings = std::function<const CrossingGrid&()>;

/// Where the particles come to on `surface` from a guess (a finite place for each) when what is next to each
/// other along `ring` moves as rigidly together as it can: an embedded deformation [Sumner et al. 2007], a
/// rotation and a translation for each of `make_pieces`, found by point-to-plane steps on the surface's own
/// values [Chen and Medioni 1992]. Unlike the nearest point of the surface this follows motions along the
/// surface, too, as far as its shape shows them: what slides in itself stays where the guess has it.
///
/// Where more than a few of a body see no surface from the guess, as beyond the band of a grid or where a
/// limb swung past itself, its pieces first come near by the places of `crossings`, those of `surface`, that
/// lie next to them and face as they do: no farther off, each time, than 1.35 times the mean size of a piece,
/// which is about half its width, or than 1.35 times its own where it is the whole body. What is on the
/// surface by the guess is held there meanwhile. `crossings` is called once at most, by this thread.
///
/// Near the surface, not on it. nullopt where the guess is on the surface already, or no step comes nearer to
/// it. Uses TBB inside; the same at any thread count.
std::optional<std::vector<Vec3>> register_to(const Surface& surface, const Crossings& crossings,
                                             const Particles& particles, const Adjacency& ring,
                                             const std::vector<Vec3>& guess);

}  // namespace isotrack
