// The few types that every stage shares.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace isotrack {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Box = Eigen::AlignedBox3d;

/// Identity of a particle over a whole run: unique, never reused, counted from 0.
using Id = std::int64_t;

/// Indices of three vertices, counter-clockwise seen from outside.
using Triangle = std::array<int, 3>;

/// An indexed triangle mesh in world units. The meshes isotrack makes are closed, oriented 2-manifolds.
struct TriangleMesh {
    std::vector<Vec3> points;
    std::vector<Triangle> triangles;
    std::vector<Id> ids;           ///< One per point, or empty. Unique within a frame.
    std::vector<Vec3> velocities;  ///< One per point, or empty. World units per second (per frame without a rate).

    bool empty() const { return triangles.empty(); }
};

}  // namespace isotrack
