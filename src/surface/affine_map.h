// Between the voxels of a grid and the world.
#pragma once

#include <openvdb/openvdb.h>

#include <cmath>
#include <string>

#include "isotrack/error.h"
#include "isotrack/types.h"

namespace isotrack {

/// How messages name a grid.
inline std::string grid_label(const openvdb::GridBase& grid) {
    return grid.getName().empty() ? "unnamed grid" : "grid '" + grid.getName() + "'";
}

struct AffineMap {
    Mat3 linear, inverse;
    Vec3 shift;
    double voxel_size;  ///< The cube root of a voxel's volume where its edges differ.

    /// \throws InputError if the grid's transform is not linear, or cannot be inverted.
    explicit AffineMap(const openvdb::GridBase& grid) {
        if (!grid.transform().isLinear())
            throw InputError(grid_label(grid) + " has a frustum transform; resample it to a linear one");
        shift = world_of(grid, openvdb::Vec3d(0.0));
        for (int axis = 0; axis < 3; ++axis) {
            openvdb::Vec3d unit(0.0);
            unit[axis] = 1.0;
            linear.col(axis) = world_of(grid, unit) - shift;
        }
        const double volume = std::abs(linear.determinant());
        if (!(volume > 0.0) || !std::isfinite(volume))
            throw InputError(grid_label(grid) + " has a transform that cannot be inverted");
        inverse = linear.inverse();
        const Vec3 edges = linear.colwise().norm();
        const bool uniform = edges.maxCoeff() - edges.minCoeff() <= 1e-9 * edges.maxCoeff();
        voxel_size = uniform ? edges[0] : std::cbrt(volume);
    }
    Vec3 to_world(const Vec3& index) const { return linear * index + shift; }
    Vec3 to_index(const Vec3& world) const { return inverse * (world - shift); }
    /// Of a gradient per voxel.
    Vec3 gradient_to_world(const Vec3& index_gradient) const { return inverse.transpose() * index_gradient; }

private:
    static Vec3 world_of(const openvdb::GridBase& grid, const openvdb::Vec3d& index) {
        const openvdb::Vec3d p = grid.indexToWorld(index);
        return {p.x(), p.y(), p.z()};
    }
};

}  // namespace isotrack
