// Surface without particles: finding it and seeding it.
#pragma once

#include <cstdint>

#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/crossing_grid.h"

namespace isotrack {

/// How far apart seeds are.
struct Sowing {
    double apart;   ///< The share of its spacing that each covers: no other is much nearer.
    double widest;  ///< Tolerances: see `widest_seed`.
};
/// A little sparse: where the tolerance is missed certify adds what it takes, which is fewer than are left
/// when there were too many. A fit leaves so small an error on what is hardly curved that a first mesh can do
/// with wider ones; without it, as much as these save is added again where edges are short.
inline constexpr Sowing kSparseSeeds{0.9, 10.0}, kSparseSeedsFitted{0.9, 20.0};
/// A little dense, for what no certify adds.
inline constexpr Sowing kDenseSeeds{0.7, 10.0};

/// The largest spacing of seeds, world units: so many tolerances, but 10 resolutions at most, as above it
/// small features are stepped over; never below 5 spacings of the crossings or `min_edge`, nor above
/// `max_edge`.
double widest_seed(const Sowing& sowing, const Surface& surface, const CrossingGrid& crossings,
                   const SizingLimits& limits);

/// Adds particles where the surface has none near, until every crossing of the surface's lattice is covered:
/// within reach of a particle that faces the same way and in whose tangent plane it nearly lies. With no
/// particles at all this is the cold start: each seed covers `sowing.apart` of its spacing, so that on
/// smooth surface no two are much nearer, in an order shuffled by `seed`. None has a larger spacing than
/// `widest_seed`, or on flat sheets than 10 tolerances, if that is more; beside the sheet such a seed covers
/// what one of `widest_seed` does. `crossings`: of the surface. Returns how many were added; new ids count on
/// from `next_id`.
std::size_t cover(Particles& particles, const Surface& surface, const CrossingGrid& crossings,
                  const SizingLimits& limits, std::uint64_t seed, Id& next_id,
                  const Sowing& sowing = kSparseSeeds);

}  // namespace isotrack
