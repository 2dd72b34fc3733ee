// Labels without edges and vertices at which the solid touches itself.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/meshing/manifold.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Relabels cells around complex edges, those with four or more boundary facets, and around pinched vertices,
/// where two sheets meet within less than the cells resolve: carved as they are, each would leave a handle or
/// a piece on its own. The cells between two of the facets, or of one of the fans at the vertex, change
/// sides, least certain first (by the value at their centroids, at most half a detail), where that leaves
/// fewer such edges and vertices than before. `carved`: of these labels; `detail`: as for
/// `guided_convection`. Deterministic. False when no label changed.
bool untangle(CellLabels& labels, const Tetrahedra& cells, const std::vector<Vec3>& points,
              const Surface& surface, const CarvedSurface& carved, std::optional<double> detail = {});

}  // namespace isotrack
