// Sharp triangles made blunter, by the other diagonal or by moving a corner along the surface.
#pragma once

#include <vector>

#include "isotrack/surface/surface.h"
#include "isotrack/types.h"

namespace isotrack {

/// One change: a flip of the edge between two triangles, or a move of one vertex.
struct Blunting {
    std::vector<int> triangle;     ///< Those concerned.
    std::vector<Triangle> before;  ///< Of each: its corners, which only a flip changes.
    int vertex = -1;               ///< That moved, or -1.
    Vec3 from = Vec3::Zero();      ///< Where it was.
};

/// Looks at the triangles with an angle below 30 degrees, sharpest first. Flips the longest edge, or moves a
/// corner that is `movable` (one entry per point) along the surface, its height above it kept, where the
/// smallest angle of the triangles concerned grows by a tenth or more, all of them face the way the surface
/// does, are within `tolerance` of it, and cross no other triangle. No two changes share a triangle. The mesh
/// must be closed, oriented, manifold and free of crossings, and stays so; its topology does not change.
/// Points that move keep no more digits than floats.
std::vector<Blunting> blunt_sharp(std::vector<Vec3>& points, std::vector<Triangle>& triangles,
                                  std::vector<char>& movable, const Surface& surface, double tolerance);

/// Takes a change back; a vertex that moved is not movable any more.
void undo(const Blunting& change, std::vector<Vec3>& points, std::vector<Triangle>& triangles,
          std::vector<char>& movable);

}  // namespace isotrack
