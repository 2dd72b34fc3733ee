// The values of grids as they come, made world distances that can be sampled.
#pragma once

#include <openvdb/openvdb.h>

namespace isotrack {

constexpr double kFarVoxels = 10.0;  ///< World distances are clamped to so many voxels.

/// Whether a grid can be sampled as it is, once the values of its voxels are known to be finite world
/// distances.
bool is_plain(const openvdb::FloatGrid& grid);

/// A float copy with `sign * (value - iso)`, active tiles turned into voxels, and no value that is not
/// finite. For float and double grids.
template <typename GridType>
openvdb::FloatGrid::Ptr float_copy(const GridType& source, double iso, double sign);

/// World units per grid unit, by the slope of the values at the surface per world unit: exact where the unit
/// is recognised. `level_set`: whether the grid says that it holds distances.
double value_scale_for(double slope, double voxel_size, bool level_set);

/// Turns values into world distances, clamped, with signs everywhere. `scale`: world units per grid unit.
void to_world_distances(openvdb::FloatGrid& own, double scale, double voxel);

}  // namespace isotrack
