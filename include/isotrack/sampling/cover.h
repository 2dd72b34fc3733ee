// Surface without particles: finding it and seeding it.
#pragma once

#include <cstdint>

#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/crossing_grid.h"

namespace isotrack {

/// Seeds this share of their spacing apart, at random, are a little sparse: where the tolerance is missed
/// certify adds what it takes, which is fewer than are left when there were too many.
constexpr double kSparseSeeds = 0.9;
/// A little dense, for what no certify adds.
constexpr double kDenseSeeds = 0.7;

/// Adds particles where the surface has none near, until every crossing of the surface's lattice is covered:
/// within reach of a particle that faces the same way and in whose tangent plane it nearly lies. With no
/// particles at all this is the cold start: each seed covers `apart` of its spacing, so that on
/// smooth surface no two are much nearer, in an order shuffled by `seed`. `crossings`: of the surface.
/// Returns how many were added; new ids count on from `next_id`.
std::size_t cover(Particles& particles, const Surface& surface, const CrossingGrid& crossings,
                  const SizingLimits& limits, std::uint64_t seed, Id& next_id, double apart = kSparseSeeds);

}  // namespace isotrack
