// Surfaces given by formulas: for tests, examples and sample sequences. Exact signed distances, gradients and closest points
// unless said otherwise. All functions throw OptionError when a length is not positive and finite.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "isotrack/surface/surface.h"

namespace isotrack::shapes {

using SurfacePtr = std::shared_ptr<const Surface>;

/// Any function that is negative inside, with its gradient by central differences of step 1e-4 `resolution`. The function must be
/// callable from several threads at once. Near the surface it should be a distance to first order.
SurfacePtr from_function(std::function<double(const Vec3&)> value, const Box& bounds, double resolution);

/// All lengths in world units; `resolution` is the smallest detail that sampling is asked to find.
SurfacePtr sphere(const Vec3& centre, double radius, double resolution);
/// Axis-aligned half axes.
SurfacePtr ellipsoid(const Vec3& centre, const Vec3& half_axes, double resolution);
/// Around the z axis. \throws OptionError unless major_radius > minor_radius.
SurfacePtr torus(const Vec3& centre, double major_radius, double minor_radius, double resolution);
/// Axis-aligned, sharp edges.
SurfacePtr box(const Vec3& centre, const Vec3& half_sizes, double resolution);
/// A disk of the given radius and thickness across z, with a rim rounded by half the thickness: `radius` is that of the whole.
SurfacePtr plate(const Vec3& centre, double radius, double thickness, double resolution);
/// The solid between two concentric spheres: two components, a void inside.
SurfacePtr shell(const Vec3& centre, double outer_radius, double thickness, double resolution);
/// Two spheres with a smooth neck: what a ball of radius `fillet` cannot enter without entering one of them. The neck is as thick
/// as that ball leaves it; once the ball reaches across the axis the solid is two drops, whose ends are pointed until
/// the spheres are 2 `fillet` apart. \throws OptionError when the spheres are so deep in each other that no neck is left.
SurfacePtr blended_spheres(const Vec3& centre_a, double radius_a, const Vec3& centre_b, double radius_b, double fillet,
                           double resolution);
/// The solid, rotated and moved.
SurfacePtr moved(SurfacePtr solid, const Eigen::Isometry3d& motion);
/// Union of solids. The distance is exact outside, a lower bound inside; exact everywhere when the parts are apart. The
/// resolution is the finest of the parts. \throws OptionError without parts.
SurfacePtr unite(std::vector<SurfacePtr> parts);

}  // namespace isotrack::shapes
