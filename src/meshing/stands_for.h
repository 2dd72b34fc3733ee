// What some triangles may be exchanged for others.
#pragma once

#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/surface/crossing_grid.h"

namespace isotrack {

/// Whether what the triangles `before`, all in `box`, stand for among `points` stays within `tolerance`, or
/// as near as it was, when `after` comes for them; `beside` are others nearby, which stay. What is farther
/// than the tolerance from those before is the concern of others.
bool stand_for_same(const CrossingGrid& points, const std::vector<FacingTriangle>& before, const Box& box,
                    const std::vector<FacingTriangle>& after, const std::vector<FacingTriangle>& beside,
                    double tolerance);

}  // namespace isotrack
