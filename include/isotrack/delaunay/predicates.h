// Exact geometric predicates on doubles.
#pragma once

#include "isotrack/types.h"

namespace isotrack {

/// The oriented Gabriel test of geometric convection: does the ball that has the circle through p, q, r as a
/// great circle hold v in its inside? Exact. Callable from any number of threads.
bool in_diametral_ball(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& v);

/// Sign of the volume of tetrahedron pqrs: +1 when s is on the side from which p, q, r run counter-clockwise;
/// 0 when flat. Exact.
int orientation(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s);

/// Are three points on one line? Exact.
bool collinear(const Vec3& p, const Vec3& q, const Vec3& r);

/// Is v inside the sphere through p, q, r, s, which are positively oriented? Exact. On the sphere it is, or
/// is not, as if each point had been lifted off it by an infinitesimal amount of its own, the more the later
/// the point is in the order of coordinates [Devillers and Teillaud 2011, "Perturbations for Delaunay and
/// weighted Delaunay 3D triangulations"]. So of five different points on a sphere every four that span a
/// volume agree on which cells are Delaunay, and none of these is flat.
bool in_sphere(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s, const Vec3& v);

}  // namespace isotrack
