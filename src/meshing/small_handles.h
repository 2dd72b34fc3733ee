// Where a mesh has a handle or a tunnel that is small.
#pragma once

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// The mesh must be closed. Those of some vertices around which the mesh within `reach`, as far as it hangs
/// together with them there, is not a disk: its Euler characteristic is 0 as that of a piece of a tube, or of
/// a sheet with a hole, or below, as where there is a handle or more openings. The lowest first, then in
/// ascending order. `looked_at`: a flag per vertex. Uses TBB inside; the result does not depend on the number
/// of threads.
std::vector<int> small_handles(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                               const std::vector<char>& looked_at, double reach);

}  // namespace isotrack
