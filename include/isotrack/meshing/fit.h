// Vertices off the surface so that the triangles are on it.
#pragma once

#include <vector>

#include "isotrack/surface/surface.h"
#include "isotrack/types.h"

namespace isotrack {

/// Vertices on a convex surface leave every triangle inside of it. `fit` moves them where the squared
/// distance between triangles and surface is least: `steps` damped Gauss-Newton steps on the surface's value
/// at ten points of each triangle, with the facets' normals for its gradient, so that each vertex solves a
/// quadric of its own [after Garland, Heckbert 1997]. The values are read once in two steps; in between
/// they change as the planes of the facets move, as those of a distance would. Two steps, the second longer
/// for the first, leave about a sixth at most of how far off the vertices were, where facets do not turn.
/// Where facets around a vertex agree it moves along their normal; where they do not, into the edge or corner
/// that they make, and the values on these facets are read at each step.
///
/// A step is at most a tenth of the shortest edge around the vertex. No triangle turns over, and none gets a
/// smallest angle below 30 degrees unless it had one; then it gets no smaller. Connectivity stays; triangles
/// far apart along the mesh may come to cross. `movable`: a flag per vertex, the others stay; empty: all
/// move. `damping`: of the quadric's trace, > 0; the less, the more freely a vertex slides along the surface.
/// Uses TBB inside; same result at any thread count.
void fit(std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles, const Surface& surface,
         int steps, const std::vector<char>& movable = {}, double damping = 0.02);

}  // namespace isotrack
