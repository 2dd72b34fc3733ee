// What frames of a tracker are tested with, on surfaces at a resolution of kVoxel.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/tracker.h"
#include "support/distance.h"
#include "support/solid.h"

namespace isotrack::support {

constexpr double kVoxel = 0.05;

inline TrackerOptions with_tolerance(double tolerance) {
    TrackerOptions options;
    options.tolerance = tolerance;
    return options;
}

/// What is promised of every frame, whatever the surface.
inline void expect_sound(const TrackedFrame& frame, std::size_t components, long euler,
                         const std::string& where) {
    SCOPED_TRACE(where);
    expect_solid(frame.mesh, components, euler);
    EXPECT_GE(enclosed_volume(frame.mesh), 0.0);
    EXPECT_EQ(frame.mesh.ids.size(), frame.mesh.points.size());
    EXPECT_EQ(frame.mesh.velocities.size(), frame.mesh.points.size());
    const std::set<Id> ids(frame.mesh.ids.begin(), frame.mesh.ids.end());
    EXPECT_EQ(ids.size(), frame.mesh.ids.size());
    for (const Vec3& v : frame.mesh.velocities) EXPECT_TRUE(v.allFinite());
    for (const Vec3& p : frame.mesh.points)
        for (int k = 0; k < 3; ++k) {
            const volatile float single =
                static_cast<float>(p[k]);  // g++ 12 drops a mere cast there and back
            EXPECT_EQ(p[k], static_cast<double>(single)) << "not what a file can hold";
        }
}

/// Largest distance from the mesh to the surface, at many points of every triangle, by the surface's own
/// exact distance.
inline double mesh_to_surface(const TriangleMesh& mesh, const Surface& surface) {
    constexpr int kSteps = 12;
    const auto probe = surface.probe();
    double largest = 0.0;
    for (const auto& [a, b, c] : mesh.triangles)
        for (int i = 0; i <= kSteps; ++i)
            for (int j = 0; i + j <= kSteps; ++j) {
                const Vec3 p =
                    (i * mesh.points[a] + j * mesh.points[b] + (kSteps - i - j) * mesh.points[c]) / kSteps;
                largest = std::max(largest, std::abs(probe->value(p)));
            }
    return largest;
}

/// Largest distance from the surface to the mesh, at every `stride`-th of its lattice crossings, put onto the
/// surface.
inline double surface_to_mesh(const Surface& surface, const TriangleMesh& mesh, std::size_t stride) {
    const auto probe = surface.probe();
    const auto crossings = surface.crossings();
    double largest = 0.0;
    for (std::size_t i = 0; i < crossings.size(); i += stride)
        if (const auto p = probe->project(crossings[i].point))
            largest = std::max(largest, distance_to_mesh(*p, mesh));
    return largest;
}

inline shapes::SurfacePtr sphere_at(const Vec3& centre, double radius = 1.0) {
    return shapes::sphere(centre, radius, kVoxel);
}

inline shapes::SurfacePtr two_drops(double half_distance) {
    return shapes::blended_spheres({-half_distance, 0, 0}, 0.5, {half_distance, 0, 0}, 0.5, 0.15, kVoxel);
}

}  // namespace isotrack::support
