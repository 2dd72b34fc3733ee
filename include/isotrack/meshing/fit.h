// Vertices off the surface so that the triangles are on it.
#pragma once

#include <vector>

#include "isotrack/surface/surface.h"
#include "isotrack/types.h"

namespace isotrack {

/// Vertices on a convex surface leave every triangle inside of it. `fit` moves the vertices along `normals`
/// (unit, outward, one per vertex) so that the signed error averages out over the triangles around each:
/// `steps` Jacobi steps, each by minus the mean of the surface's value at ten points of each triangle,
/// weighted by area and barycentric coordinate. A step is at most a tenth of the shortest edge around the
/// vertex, so that no triangle turns over at once. Connectivity stays. Uses TBB inside; same result at any
/// thread count.
void fit(std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles,
         const std::vector<Vec3>& normals, const Surface& surface, int steps);

}  // namespace isotrack
