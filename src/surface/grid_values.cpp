#include "surface/grid_values.h"

#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "surface/inactive_tiles.h"

namespace isotrack {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;

bool is_plain(const FloatGrid& grid) {
    const float background = grid.background();
    if (!(background > 0.0f) || !std::isfinite(background) || grid.tree().activeTileCount() > 0) return false;
    bool finite = true;
    for_each_inactive_tile(grid.tree(), [&](float value) { finite = finite && std::isfinite(value); });
    return finite;
}

template <typename GridType>
FloatGrid::Ptr float_copy(const GridType& source, double iso, double sign) {
    using Value = typename GridType::ValueType;
    const auto convert = [=](Value v) {
        const double shifted = sign * (static_cast<double>(v) - iso);
        if (std::isnan(shifted)) return std::numeric_limits<float>::max();
        return static_cast<float>(std::clamp<double>(shifted, std::numeric_limits<float>::lowest(),
                                                     std::numeric_limits<float>::max()));
    };
    const auto voxels = source.deepCopy();
    voxels->tree().voxelizeActiveTiles();
    auto copy = FloatGrid::create(convert(source.background()));
    copy->setTransform(source.transform().copy());
    copy->setTree(
        std::make_shared<FloatTree>(voxels->tree(), convert(source.background()), openvdb::TopologyCopy()));
    const auto source_accessor = source.getConstAccessor();
    openvdb::tree::LeafManager<FloatTree> leaves(copy->tree());
    leaves.foreach ([&](Leaf& leaf, std::size_t) {
        auto reader = source.getConstUnsafeAccessor();
        float* data = leaf.buffer().data();
        for (openvdb::Index i = 0; i < Leaf::SIZE; ++i)
            data[i] = convert(reader.getValue(leaf.offsetToGlobalCoord(i)));
    });
    // Inactive tiles keep the sign they had.
    for (auto tile = copy->tree().beginValueOff(); tile; ++tile)
        if (!tile.isVoxelValue()) tile.setValue(convert(source_accessor.getValue(tile.getCoord())));
    return copy;
}

template FloatGrid::Ptr float_copy(const FloatGrid&, double, double);
template FloatGrid::Ptr float_copy(const openvdb::DoubleGrid&, double, double);

double value_scale_for(double slope, double voxel_size, bool level_set) {
    // Central differences across sheets of a voxel or two are too short: what says it holds distances is
    // believed for longer.
    const double recognised = std::log(level_set ? 2.5 : 1.25);
    if (!(slope > 0.0)) return 1.0;
    const double off_world = std::abs(std::log(slope)), off_voxels = std::abs(std::log(slope * voxel_size));
    if (std::min(off_world, off_voxels) > recognised) return 1.0 / slope;
    return off_world <= off_voxels ? 1.0 : voxel_size;
}

namespace {

constexpr int kCapLayers = 4;  // voxels added beyond a block whose border cuts the surface

/// A dense block whose background says nothing: adds voxels around it so that the surface goes straight on
/// past the block's last voxels and is cut by a flat cap one voxel beyond them.
void cap_block(FloatGrid& grid, const openvdb::CoordBBox& block, double voxel) {
    const auto outer =
        openvdb::CoordBBox(block.min().offsetBy(-kCapLayers), block.max().offsetBy(kCapLayers));
    const FloatGrid::ConstPtr inside = grid.deepCopy();
    auto accessor = grid.getAccessor();
    const auto reader = inside->getConstAccessor();
    for (auto c = outer.begin(); c; ++c) {
        Coord nearest = *c;
        nearest.minComponent(block.max());
        nearest.maxComponent(block.min());
        // Distance to the cap in voxels: negative in front of it.
        int depth = std::numeric_limits<int>::min();
        for (int axis = 0; axis < 3; ++axis) {
            const int past_top = (*c)[axis] - block.max()[axis] - 1,
                      past_bottom = block.min()[axis] - 1 - (*c)[axis];
            depth = std::max({depth, past_top, past_bottom});
        }
        const float cap = static_cast<float>(depth * voxel);
        if (depth < -kCapLayers) continue;
        accessor.setValue(*c, std::max(reader.getValue(nearest), cap));
    }
}

/// Gives every inactive voxel and tile the value `outside`.
void set_outside(FloatGrid& own, float outside) {
    for (auto value = own.tree().beginValueOff(); value; ++value) value.setValue(outside);
    own.tree().root().setBackground(outside, /*updateChildNodes=*/false);
}

}  // namespace

void to_world_distances(FloatGrid& own, double scale, double voxel) {
    const float far = static_cast<float>(kFarVoxels * voxel);
    const float factor = static_cast<float>(scale);
    const float old_background = own.background();
    // Zero stays zero and means outside: a block's background of 0 is mended below.
    const auto convert = [=](float v) { return std::clamp(v * factor, -far, far); };
    openvdb::tree::LeafManager<FloatTree> leaves(own.tree());
    leaves.foreach ([&](Leaf& leaf, std::size_t) {
        float* data = leaf.buffer().data();
        for (openvdb::Index i = 0; i < Leaf::SIZE; ++i) data[i] = convert(data[i]);
    });
    for (auto tile = own.tree().beginValueOff(); tile; ++tile)
        if (!tile.isVoxelValue()) tile.setValue(convert(tile.getValue()));

    const bool silent = !(old_background > 0.0f);
    const float background = silent ? static_cast<float>(3.0 * voxel) : convert(old_background);
    if (silent) {
        const auto block = own.evalActiveVoxelBoundingBox();
        const bool dense = own.activeVoxelCount() == block.volume();
        set_outside(own, background);
        if (dense && !block.empty())
            cap_block(own, block, voxel);
        else
            openvdb::tools::signedFloodFill(own.tree());
    } else if (background != old_background) {
        own.tree().root().setBackground(background, /*updateChildNodes=*/false);
    }
    own.setGridClass(openvdb::GRID_LEVEL_SET);
}

}  // namespace isotrack
