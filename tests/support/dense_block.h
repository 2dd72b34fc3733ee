// A grid as simulations write them that keep whole boxes.
#pragma once

#include <openvdb/openvdb.h>

#include "isotrack/types.h"

namespace isotrack::support {

/// A dense block 0..n-1 in each axis, class level set, background 0, made of a function of the world
/// position.
template <typename Function>
openvdb::FloatGrid::Ptr dense_block(int n, double voxel, const Function& value) {
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto accessor = grid->getAccessor();
    for (auto c = openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(n - 1)).begin(); c; ++c) {
        const auto p = grid->indexToWorld(*c);
        accessor.setValue(*c, static_cast<float>(value(Vec3(p.x(), p.y(), p.z()))));
    }
    return grid;
}

}  // namespace isotrack::support
