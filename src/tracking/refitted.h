// The last fit of a frame's mesh, with flips, held to what the mesh was certified for.
#pragma once

#include <vector>

#include "isotrack/surface/surface.h"
#include "tracking/inspection.h"

namespace isotrack {

/// Refits a certified mesh, and takes that back, with the triangles around where that is not enough, and in
/// the end all, where triangles came to be farther from the surface than `tolerance` and than before, to turn
/// over, to be sharp (below 30 degrees) and sharper than before, or to cross, and where crossings are missed
/// that were not. `before`: the inspection of the mesh; returns that of what it becomes, without the
/// topology, which stays. `inspector`: the mesh's. `movable`: a flag per vertex, the others stay.
Inspection refit_within(FrameMesh& mesh, const Inspection& before, const std::vector<char>& movable,
                        const Surface& surface, double tolerance, Inspector& inspector);

}  // namespace isotrack
