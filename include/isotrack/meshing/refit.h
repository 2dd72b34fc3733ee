// Edges along the creases of a surface, and vertices on them.
#pragma once

#include <array>
#include <vector>

#include "isotrack/surface/surface.h"
#include "isotrack/types.h"

namespace isotrack {

/// Lowers the squared distance between triangles and surface by flips of edges, then a few steps of `fit`: an
/// edge across a crease cuts it, and a fit cannot help that; once edges follow the crease, it moves them onto
/// it. The mesh must be closed, oriented and manifold, and stays so; its topology does not change.
///
/// An edge flips where the error of its two triangles, area times mean square, falls by a tenth or more, and
/// is at least a tenth of what it is on average; where none of the new ones has an angle below 30 degrees,
/// or below what the old ones had; where both are within `tolerance` and face the way the surface does, or no
/// worse than the old ones. What a flip may gain is guessed first, from the values on the old triangles.
/// `movable`: a flag per vertex; the others stay, and so do the edges of triangles around them.
///
/// Returns the two triangles of each flip; no two flips share one. A flip puts its new triangles in the
/// places of the old and makes no edge that the mesh had before, so each can be taken back alone. Triangles
/// far apart along the mesh may come to cross. Uses TBB inside; same result at any thread count.
std::vector<std::array<int, 2>> refit(std::vector<Vec3>& vertices, std::vector<Triangle>& triangles,
                                      const Surface& surface, double tolerance,
                                      const std::vector<char>& movable);

}  // namespace isotrack
