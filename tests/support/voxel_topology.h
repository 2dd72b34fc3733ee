// How many pieces a level set has, counted on the signs of its voxels: independent of any meshing.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <vector>

namespace isotrack::testing {

struct VoxelComponents {
    std::size_t inside = 0;  ///< 6-connected sets of voxels below `iso`.
    std::size_t outside =
        0;  ///< 6-connected sets of the others: 1 for the outer space, and one more for each void.
};

/// Scans the box of the active voxels, one voxel wider to each side and dense: for small grids. Inactive
/// voxels count by their value.
template <class GridT>
VoxelComponents voxel_components(const GridT& grid, double iso = 0.0) {
    openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    if (grid.empty()) return {0, 1};
    box.expand(1);
    const openvdb::Coord dim = box.dim();
    const std::size_t ny = dim.y(), nz = dim.z(), count = dim.x() * ny * nz;

    std::vector<char> is_inside(count), is_seen(count, 0);
    auto access = grid.getConstAccessor();
    std::size_t index = 0;
    for (auto ijk = box.begin(); ijk; ++ijk, ++index)
        is_inside[index] = access.getValue(*ijk) < iso;  // z runs fastest

    VoxelComponents result;
    std::vector<std::size_t> stack;
    for (std::size_t seed = 0; seed < count; ++seed) {
        if (is_seen[seed]) continue;
        ++(is_inside[seed] ? result.inside : result.outside);
        is_seen[seed] = 1;
        stack.push_back(seed);
        const auto visit = [&](std::size_t to) {
            if (is_seen[to] || is_inside[to] != is_inside[seed]) return;
            is_seen[to] = 1;
            stack.push_back(to);
        };
        while (!stack.empty()) {
            const std::size_t at = stack.back();
            stack.pop_back();
            const std::size_t x = at / (ny * nz), y = at / nz % ny, z = at % nz;
            if (x > 0) visit(at - ny * nz);
            if (x + 1 < static_cast<std::size_t>(dim.x())) visit(at + ny * nz);
            if (y > 0) visit(at - nz);
            if (y + 1 < ny) visit(at + nz);
            if (z > 0) visit(at - 1);
            if (z + 1 < nz) visit(at + 1);
        }
    }
    return result;
}

}  // namespace isotrack::testing
