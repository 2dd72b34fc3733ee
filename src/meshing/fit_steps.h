// The steps of a fit between two readings of the surface.
#pragma once

#include <vector>

#include "isotrack/types.h"
#include "meshing/corners.h"
#include "meshing/facet_values.h"

namespace isotrack {

/// Steps of `fit`, with values that change from `facets` on (one per triangle) as the planes of the facets
/// move. Those at creases change otherwise: they are read again at each step. `corners`: of the triangles,
/// which must be all around a movable vertex.
void fit_steps(std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles, const Corners& corners,
               std::vector<FacetValues> facets, const Surface& surface, int steps,
               const std::vector<char>& movable, double damping);

}  // namespace isotrack
