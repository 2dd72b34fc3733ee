// A point of the surface near a place, also where Newton's method finds none.
#pragma once

#include <optional>

#include "isotrack/surface/surface.h"

namespace isotrack {

/// The projection of p. Where that fails or is farther away than `distance`, as next to kinks of interpolated
/// values: the nearest of the points in which segments of that length from p, along the axes and the
/// diagonals of faces and cells, first leave its side, as far as steps of a quarter show; none if they stay
/// there.
std::optional<Vec3> surface_near(Surface::Probe& probe, const Vec3& p, double distance);

}  // namespace isotrack
