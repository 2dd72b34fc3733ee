// Delaunay refinement of the boundary between inside and outside cells, where it changes.
#pragma once

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/meshing/convection.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Breaks boundary facets that are too far from the surface, turned from it or needles at their dual crossing
/// [Boissonnat, Oudot 2005], then those that fail among the facets that come, until none does or nothing more
/// can be done. Looks only at cells that changed since they were labelled last: in a mesh of which the rest
/// was inspected the cost goes with what is added. `labels` follow; `dt` is that of the particles, before and
/// after. Uses TBB inside; same result at any thread count.
void refine(Tetrahedralisation& dt, CellLabels& labels, Particles& particles, Densifier& densifier,
            const Surface& surface, const SizingLimits& limits);

}  // namespace isotrack
