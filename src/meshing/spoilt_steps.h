// What steps of vertices do to their triangles.
#pragma once

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Shortens steps, from `vertices` to `to`, around triangles that they turn over, or that get an angle below
/// 30 degrees that is smaller than it was; takes them back where that is not enough. A step is at most a
/// tenth of the edges around its vertex. `triangles` must have all around a movable vertex. `movable`: a flag
/// per vertex, the others make no steps. Uses TBB inside.
void undo_spoilt_steps(const std::vector<Vec3>& vertices, std::vector<Vec3>& to,
                       const std::vector<Triangle>& triangles, const std::vector<char>& movable);

}  // namespace isotrack
