// Where velocity fields take points from one frame to the next.
#pragma once

#include <openvdb/openvdb.h>

#include "isotrack/tracking/tracker.h"

namespace isotrack {

/// Along the field of one frame by the midpoint rule; then, if there is a field of the next frame, `to`, by
/// the trapezoidal rule with its velocity at the end found so far, twice: exact where the velocity is the
/// same all around and changes at a constant rate. A field is what its active voxels say, often around a
/// surface alone: a velocity on the way counts if some of the eight next to it are active (of a staggered
/// grid, for each component), and if it differs from that at the start by less than half of that: what is
/// beside a drop that flies says nothing about it. A start without such voxels has the value of the nearest
/// all the same; one whose velocity is not finite rests. `from` must not be null; `time`: between the frames,
/// in the unit of the velocities. Any number of threads may call what is returned.
Tracker::Motion motion_along(const openvdb::Vec3SGrid::ConstPtr& from, const openvdb::Vec3SGrid::ConstPtr& to,
                             double time);

}  // namespace isotrack
