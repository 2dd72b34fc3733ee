// Deaths that the mesh can do without.
#pragma once

#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/crossing_grid.h"

namespace isotrack {

/// What a particle may leave behind.
struct ThinningLimits {
    double crowded;  ///< It may go below this distance to the nearest neighbour, in units of the
                     ///< spacing as `PopulationBand`.
    double error;    ///< Largest error of the triangles that close its gap, world units.
    double reach;    ///< Largest distance of a crossing from them, unless it was farther off before.
    double detail;   ///< As `SizingLimits`.
};

/// Takes particles away, the most crowded first, whose gap in the mesh of `triangles` can be closed by
/// triangles that are near enough to the surface, and it to them, do not turn from it, and have no angle
/// below 30 degrees or none sharper than those that go. Whoever is on a rim, in no fan, or faces away from
/// all neighbours stays. `ring`: who shares an edge of the triangles with whom. Where it has other pairs, as
/// around particles that were lost, others may count as crowded at first, which does the mesh no harm. Uses
/// TBB inside; the same at any thread count. Returns flags for `Particles::retain`; `triangles` are then
/// those of the mesh without them, and still have the old numbers.
std::vector<char> thin(const Particles& particles, std::vector<Triangle>& triangles, const Adjacency& ring,
                       const Surface& surface, const CrossingGrid& crossings, const ThinningLimits& limits);

}  // namespace isotrack
