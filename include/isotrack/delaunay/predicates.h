// Exact geometric predicates on doubles.
#pragma once

#include "isotrack/types.h"

namespace isotrack {

/// The oriented Gabriel test of geometric convection: does the ball that has the circle through p, q, r as a great circle hold v in
/// its inside? Exact. Callable from any number of threads.
bool in_diametral_ball(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& v);

/// Sign of the volume of tetrahedron pqrs: +1 when s is on the side from which p, q, r run counter-clockwise; 0 when flat. Exact.
int orientation(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s);

}  // namespace isotrack
