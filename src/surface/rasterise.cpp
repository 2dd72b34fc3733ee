#include "isotrack/surface/rasterise.h"

#include <openvdb/tools/SignedFloodFill.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "isotrack/error.h"

namespace isotrack {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
using openvdb::Coord;

constexpr int kHalfWidthVoxels = 3;
constexpr int kLargestBlock = 512;  // voxels along an edge; any power of two times the leaf's

/// Calls `body(probe, i)` for i in [0, count), each thread with its own probe.
template <class Body>
void for_each_with_probe(const Surface& surface, std::size_t count, const Body& body) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 16), [&](const auto& range) {
        const auto probe = surface.probe();
        for (std::size_t i = range.begin(); i != range.end(); ++i) body(*probe, i);
    });
}

std::vector<Coord> blocks_over(const openvdb::CoordBBox& box, int size) {
    const auto aligned = [size](int i) { return i & ~(size - 1); };
    std::vector<Coord> blocks;
    for (int x = aligned(box.min().x()); x <= box.max().x(); x += size)
        for (int y = aligned(box.min().y()); y <= box.max().y(); y += size)
            for (int z = aligned(box.min().z()); z <= box.max().z(); z += size) blocks.emplace_back(x, y, z);
    return blocks;
}

/// Those of the blocks that can hold a voxel of the band: the value at the centre bounds all values in the
/// block.
std::vector<Coord> blocks_at_surface(const Surface& surface, const std::vector<Coord>& blocks, int size,
                                     double voxel) {
    const double to_centre = 0.5 * (size - 1);
    const double reach = (std::sqrt(3.0) * to_centre + kHalfWidthVoxels) * voxel;
    std::vector<char> is_at_surface(blocks.size());
    for_each_with_probe(surface, blocks.size(), [&](Surface::Probe& probe, std::size_t i) {
        const Vec3 origin(blocks[i].x(), blocks[i].y(), blocks[i].z());
        is_at_surface[i] = std::abs(probe.value(voxel * (origin + Vec3::Constant(to_centre)))) <= reach;
    });
    std::vector<Coord> kept;
    for (std::size_t i = 0; i < blocks.size(); ++i)
        if (is_at_surface[i]) kept.push_back(blocks[i]);
    return kept;
}

std::vector<Coord> halved(const std::vector<Coord>& blocks, int half) {
    std::vector<Coord> parts;
    parts.reserve(8 * blocks.size());
    for (const Coord& block : blocks)
        for (int i = 0; i < 8; ++i)
            parts.push_back(block.offsetBy(i & 4 ? half : 0, i & 2 ? half : 0, i & 1 ? half : 0));
    return parts;
}

/// The leaf at `origin`, or null when none of its voxels is in the band.
std::unique_ptr<Leaf> sample_leaf(Surface::Probe& probe, const Coord& origin, double voxel) {
    const float background = static_cast<float>(kHalfWidthVoxels * voxel);
    auto leaf = std::make_unique<Leaf>(origin, background, false);
    for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) {
        const Coord ijk = leaf->offsetToGlobalCoord(n);
        const float value = static_cast<float>(probe.value(voxel * Vec3(ijk.x(), ijk.y(), ijk.z())));
        if (std::abs(value) < background)
            leaf->setValueOn(n, value);
        else
            leaf->setValueOnly(n, value < 0.0f ? -background : background);
    }
    return leaf->isEmpty() ? nullptr : std::move(leaf);
}

}  // namespace

openvdb::FloatGrid::Ptr rasterise(const Surface& surface, double voxel) {
    if (!(voxel > 0.0) || !std::isfinite(voxel))
        throw OptionError("the voxel size must be a positive length, got " + std::to_string(voxel));
    auto grid = openvdb::FloatGrid::create(static_cast<float>(kHalfWidthVoxels * voxel));
    grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    const Box bounds = surface.bounds();
    if (bounds.isEmpty()) return grid;

    const openvdb::Vec3d low(bounds.min().data()), high(bounds.max().data());
    openvdb::CoordBBox box(Coord::floor(low / voxel), Coord::ceil(high / voxel));
    box.expand(kHalfWidthVoxels);

    std::vector<Coord> blocks = blocks_over(box, kLargestBlock);
    for (int size = kLargestBlock;; size /= 2) {
        blocks = blocks_at_surface(surface, blocks, size, voxel);
        if (size == static_cast<int>(Leaf::DIM)) break;
        blocks = halved(blocks, size / 2);
    }
    std::vector<std::unique_ptr<Leaf>> leaves(blocks.size());
    for_each_with_probe(surface, blocks.size(), [&](Surface::Probe& probe, std::size_t i) {
        leaves[i] = sample_leaf(probe, blocks[i], voxel);
    });
    for (std::unique_ptr<Leaf>& leaf : leaves)
        if (leaf) grid->tree().addLeaf(leaf.release());
    openvdb::tools::signedFloodFill(grid->tree());
    return grid;
}

}  // namespace isotrack
