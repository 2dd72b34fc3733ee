// Surface without particles: finding it and seeding it.
#pragma once

#include <cstdint>

#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/crossing_grid.h"

namespace isotrack {

/// Adds particles where the surface has none near, until every crossing of the surface's lattice is covered:
/// within reach of a particle that faces the same way and in whose tangent plane it nearly lies. With no
/// particles at all this is the cold start: seeds at 0.7 of their spacing, in an order shuffled by `seed`.
/// `crossings`: of the surface. Returns how many were added; new ids count on from `next_id`.
std::size_t cover(Particles& particles, const Surface& surface, const CrossingGrid& crossings,
                  const SizingLimits& limits, std::uint64_t seed, Id& next_id);

}  // namespace isotrack
