// Values that do not stop at the end of a grid's band.
#pragma once

#include <cmath>

#include "isotrack/surface/surface.h"

namespace isotrack {

/// The value at p; a resolution and more from the surface the farther one, which is known as far as
/// `reach()`.
inline double far_value(Surface::Probe& probe, const Vec3& p, double resolution) {
    const double value = probe.value(p);
    return std::abs(value) < resolution ? value : probe.farther_value(p);
}

}  // namespace isotrack
