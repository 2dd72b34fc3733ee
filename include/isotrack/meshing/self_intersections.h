// Pairs of triangles that cross.
#pragma once

#include <utility>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Pairs (i < j, ascending) of triangles that share more than their common vertices and edges, decided exactly (CGAL). Vertices at the same
/// place count as common, so that the copies that keep a mesh manifold do not intersect each other by touching.
std::vector<std::pair<int, int>> self_intersections(const TriangleMesh& mesh);

}  // namespace isotrack
