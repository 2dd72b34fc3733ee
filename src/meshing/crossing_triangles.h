// Which triangles of a mesh cross others.
#pragma once

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Flags for the triangles that cross others, by `self_intersections`; at least one of each pair is `fresh`.
/// The cost goes with those that are near a fresh one. Uses TBB inside.
std::vector<char> crossing_triangles(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                     const std::vector<char>& fresh);

}  // namespace isotrack
