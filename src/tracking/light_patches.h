// Patches with no more vertices than they need.
#pragma once

#include <cstddef>

#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/surface.h"
#include "tracking/mesh_trials.h"

namespace isotrack {

/// Takes vertices that stand on no particle out of a mesh, as far as triangles that change are within the
/// tolerance. Where it would not reach what it reached before they stay around there, or all where that does
/// not do. Returns how many went.
std::size_t lighten_patches(MeshTrials& trials, const Surface& surface, const SizingLimits& limits);

}  // namespace isotrack
