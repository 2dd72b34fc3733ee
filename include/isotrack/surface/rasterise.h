// From a surface to a narrow-band level set grid.
#pragma once

#include <openvdb/openvdb.h>

#include "isotrack/surface/surface.h"

namespace isotrack {

/// The surface as a grid of class level set: its values at the voxel centres (index times `voxel`) in a band of 3 voxels to
/// either side, world units; beyond it inactive and of the right sign. No voxel is active when there is no surface.
///
/// The values must be distances, or at least change by no more than the distance walked, as those of all `shapes` but
/// `from_function` do: whole blocks are left out by the value at their centre. Cost is proportional to the voxels of the band. Uses TBB
/// inside; the same result at any thread count.
/// \throws OptionError unless `voxel` is a positive length.
openvdb::FloatGrid::Ptr rasterise(const Surface& surface, double voxel);

}  // namespace isotrack
