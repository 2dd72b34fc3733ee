#include "surface/grid_part.h"

#include <algorithm>

namespace isotrack {
namespace {

using openvdb::Coord;
using Leaf = openvdb::FloatTree::LeafNodeType;

constexpr double kMostCopied = 0.25, kMostLooks = 8.0;  // of a grid's leaves
constexpr double kDim = Leaf::DIM, kFarthest = (1 << 30) / kDim;

/// Lowest nodes of leaves, in leaves; in floating point, as places may be anywhere.
struct LeafBox {
    Vec3 from, to;  // inclusive

    LeafBox(const Vec3& place, const Vec3& reach)
        : from(((place - reach) / kDim).array().floor()), to(((place + reach) / kDim).array().floor()) {}
    double volume() const { return (to - from + Vec3::Ones()).prod(); }
};

}  // namespace

openvdb::FloatGrid::Ptr part_around(const openvdb::FloatGrid& grid, const std::vector<Vec3>& places,
                                    const Vec3& reach) {
    const auto leaves = static_cast<double>(grid.tree().leafCount());
    double looks = 0.0;
    for (const Vec3& place : places) looks += LeafBox(place, reach).volume();
    if (!(looks <= kMostLooks * leaves)) return nullptr;
    std::vector<Coord> around;
    around.reserve(static_cast<std::size_t>(looks));
    for (const Vec3& place : places) {
        const LeafBox box(place, reach);
        if (!(std::max(box.from.lpNorm<Eigen::Infinity>(), box.to.lpNorm<Eigen::Infinity>()) < kFarthest))
            continue;  // no grid has nodes there
        const Eigen::Vector3i from = box.from.cast<int>(), to = box.to.cast<int>();
        for (auto leaf = openvdb::CoordBBox({from.x(), from.y(), from.z()}, {to.x(), to.y(), to.z()}).begin();
             leaf; ++leaf)
            around.push_back(*leaf);
    }
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());

    const openvdb::FloatGrid::Ptr part = grid.copyWithNewTree();
    const auto from = grid.getConstAccessor();
    double copied = 0.0;
    for (const Coord& at : around) {
        const Coord origin = at << static_cast<int>(Leaf::LOG2DIM);
        if (const Leaf* leaf = from.probeConstLeaf(origin)) {
            if (++copied > kMostCopied * leaves) return nullptr;
            part->tree().addLeaf(new Leaf(*leaf));  // which the tree owns
        } else if (const float value = from.getValue(origin); value != grid.background()) {
            part->tree().addTile(1, origin, value, from.isValueOn(origin));
        }
    }
    return part;
}

}  // namespace isotrack
