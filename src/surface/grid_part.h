// A small part of a grid.
#pragma once

#include <openvdb/openvdb.h>

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// At least what a grid has within `reach` nodes along each axis of some places in voxels, by whole leaves,
/// and tiles cut to the same size; its background elsewhere. Null where that is more than a quarter of the
/// grid's leaves, or where looking for it would take as long as going through all of them.
openvdb::FloatGrid::Ptr part_around(const openvdb::FloatGrid& grid, const std::vector<Vec3>& places,
                                    const Vec3& reach);

}  // namespace isotrack
