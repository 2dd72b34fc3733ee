// What users would take instead.
#pragma once

#include "isotrack/surface/level_set.h"
#include "isotrack/types.h"

namespace isotrack {

/// OpenVDB's own mesher at adaptivity 0 (uniform) to 1 (coarsest). Quads are split by their shorter diagonal.
/// Triangles are oriented outward, as in all of isotrack. \throws OptionError for an adaptivity outside [0,
/// 1].
TriangleMesh volume_to_mesh(const LevelSet& level_set, double adaptivity = 0.0);

}  // namespace isotrack
