// Whether triangles of a mesh may be replaced by others.
#pragma once

#include <array>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/surface/crossing_grid.h"

namespace isotrack {

/// What would be replaced.
struct Replaced {
    double facing;  ///< The least cosine between normals of its triangles and the surface's.
    std::vector<FacingTriangle> triangles;
    std::vector<FacingTriangle> beside;  ///< Others that have a vertex in common with these.
    Box box;
};

/// A triangle by where its corners are.
using Places = std::array<Vec3, 3>;

/// A mesh and what it has to keep. Threads may share it, each with a probe of its own.
struct ReplaceableMesh {
    const std::vector<Vec3>& points;
    const std::vector<Triangle>& triangles;
    double tolerance;
    double detail;  ///< What is smaller need not be looked at.
    const std::vector<const CrossingGrid*>& reached;

    Places places_of(const Triangle& t) const { return {points[t[0]], points[t[1]], points[t[2]]}; }
    /// `beside`: triangles that have a vertex in common with those of `numbers`, which may be among them.
    Replaced replaced(std::vector<int> numbers, std::vector<int> beside, Surface::Probe& probe) const;
    /// Whether all these triangles face the way the surface does, or no worse than those they stand for, are
    /// within the tolerance of it, and with those beside them keep what those stand for of what is reached
    /// within the tolerance.
    bool may_have(const std::vector<Places>& candidates, const Replaced& before, Surface::Probe& probe) const;
};

}  // namespace isotrack
