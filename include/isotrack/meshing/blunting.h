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

/// Makes the sharp triangles of a mesh blunter, pass by pass. The mesh must be closed, oriented, manifold and
/// free of crossings, and stays so; its topology does not change.
class Blunter {
public:
    /// All but `movable` (one entry per point) must outlive it; nobody else may change the mesh meanwhile.
    Blunter(std::vector<Vec3>& points, std::vector<Triangle>& triangles, std::vector<char> movable,
            const Surface& surface, double tolerance);

    /// Looks at the triangles with an angle below 30 degrees, sharpest first, but for those that were looked
    /// at in vain and have not changed since. Flips the longest edge, or moves a corner that is movable along
    /// the surface, its height above it kept, where the smallest angle of the triangles concerned grows by a
    /// tenth or more, all of them face the way the surface does, or no worse than before, are within
    /// `tolerance` of it, and cross no other triangle. No two changes of a pass share a triangle. Points that
    /// move keep no more digits than floats.
    std::vector<Blunting> pass();

    /// Takes a change of the last pass back; a vertex that moved is not movable any more.
    void undo(const Blunting& change);

private:
    void undo_crossing(std::vector<Blunting>& changes);
    void reopen(const Blunting& change);

    std::vector<Vec3>& points_;
    std::vector<Triangle>& triangles_;
    std::vector<char> movable_;
    const Surface& surface_;
    double tolerance_;
    std::vector<char> open_;  // per vertex: triangles around it are to be looked at
};

}  // namespace isotrack
