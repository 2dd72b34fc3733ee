// A mesh without vertices that it can do without.
#pragma once

#include <vector>

#include "isotrack/surface/crossing_grid.h"
#include "isotrack/types.h"

namespace isotrack {

/// What became of each triangle of a mesh, flags: those that are gone are still in the list; others may have
/// other corners.
struct Lightened {
    std::vector<char> gone, changed;
};

/// Takes vertices that may go, by their flags, out of a closed, oriented manifold, each by drawing it along
/// an edge onto another vertex [Hoppe 1996, "Progressive meshes"], along short edges first. The mesh stays
/// what it is, with the same topology and no crossings it had not; every triangle that changes is within
/// `tolerance` of the surface, faces the way it does or better than what it stands for, and has no angle
/// that is below 22 degrees and below the least around; what was stood for among `reached` is so within the
/// tolerance, or as near as before. `detail`: that of `certified_error`. The cost goes with the triangles
/// near those that may change, and a little with all. Uses TBB inside; the same at any thread count.
Lightened lighten(const std::vector<Vec3>& points, std::vector<Triangle>& triangles,
                  const std::vector<char>& may_go, const Surface& surface,
                  const std::vector<const CrossingGrid*>& reached, double tolerance, double detail);

}  // namespace isotrack
