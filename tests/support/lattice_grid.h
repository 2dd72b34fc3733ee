// Small level sets with known values at their nodes.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>

#include "isotrack/types.h"

namespace isotrack::support {

/// Voxels of 1, a band of 3: the nodes from `low` to `high` have the distance there, within the band; the
/// background is outside.
template <typename Distance>
openvdb::FloatGrid::Ptr lattice_grid(const openvdb::Coord& low, const openvdb::Coord& high,
                                     const Distance& distance) {
    constexpr double kBand = 3.0;
    auto grid = openvdb::FloatGrid::create(kBand);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (auto c = openvdb::CoordBBox(low, high).begin(); c; ++c)
        values.setValue(*c, static_cast<float>(std::clamp<double>(
                                distance(Vec3((*c).x(), (*c).y(), (*c).z())), -kBand, kBand)));
    return grid;
}

}  // namespace isotrack::support
