// A body with a limb that bends, for what moves farther than it is thick.
#pragma once

#include "isotrack/surface/shapes.h"

namespace isotrack::support {

/// About the joint, which is on the surface of the body.
inline Eigen::Isometry3d limb_bend(double radians) {
    const Eigen::Translation3d joint(0.7, 0, 0);
    return joint * Eigen::AngleAxisd(radians, Vec3(0.1, 0.2, 1.0).normalized()) * joint.inverse();
}

/// The limb ends at x = 2.3 when it is not bent, and is 0.4 thick.
inline shapes::SurfacePtr with_limb(const Eigen::Isometry3d& bend, double resolution) {
    return shapes::unite({shapes::ellipsoid({0, 0, 0}, {0.8, 0.6, 0.45}, resolution),
                          shapes::moved(shapes::ellipsoid({1.4, 0, 0}, {0.9, 0.2, 0.2}, resolution), bend)});
}

}  // namespace isotrack::support
