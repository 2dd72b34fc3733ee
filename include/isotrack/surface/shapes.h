// Surfaces given by formulas: for tests, examples and sample sequences. Exact distances unless said otherwise.
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
/// Axis-aligned half axes. The value is a first-order distance, exact on the surface.
SurfacePtr ellipsoid(const Vec3& centre, const Vec3& half_axes, double resolution);
/// Around the z axis.
SurfacePtr torus(const Vec3& centre, double major_radius, double minor_radius, double resolution);
/// Axis-aligned, sharp edges.
SurfacePtr box(const Vec3& centre, const Vec3& half_sizes, double resolution);
/// A disk of the given radius and thickness across z, with a rim rounded by half the thickness.
SurfacePtr plate(const Vec3& centre, double radius, double thickness, double resolution);
/// The solid between two concentric spheres: two components, a void inside.
SurfacePtr shell(const Vec3& centre, double outer_radius, double thickness, double resolution);
/// Union of solids. The distance is exact outside, a lower bound inside. The resolution is the finest of the parts.
SurfacePtr unite(std::vector<SurfacePtr> parts);

}  // namespace isotrack::shapes
