// Sharp triangles made blunter by the other diagonal.
#pragma once

#include <array>
#include <vector>

#include "isotrack/surface/surface.h"
#include "isotrack/types.h"

namespace isotrack {

/// Two triangles that stand on the other diagonal of their four vertices now.
struct Flip {
    std::array<int, 2> triangle;
    std::array<Triangle, 2> before;
};

/// Flips the longest edge of triangles with an angle below 30 degrees, sharpest first, where the smallest
/// angle of the two triangles beside it grows by a tenth or more, both face the way the surface does, both
/// are within `tolerance` of it, and neither crosses any other triangle. No two flips share a vertex. The
/// mesh must be closed, oriented, manifold and free of crossings, and stays so; its topology does not change.
std::vector<Flip> flip_sharp(const std::vector<Vec3>& points, std::vector<Triangle>& triangles,
                             const Surface& surface, double tolerance);

/// Takes a flip back.
void undo(const Flip& flip, std::vector<Triangle>& triangles);

}  // namespace isotrack
