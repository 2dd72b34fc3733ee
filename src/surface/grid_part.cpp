#include "surface/grid_part.h"

#include <algorithm>

namespace isotrack {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using Leaf = openvdb::FloatTree::LeafNodeType;

constexpr double kMostCopied = 0.25, kMostLooks = 8.0;  // of a grid's leaves

/// In leaves.
CoordBBox leaves_around(const Vec3& place, const Vec3& reach) {
    const auto leaf_of = [](const Vec3& p) {
        return Coord(openvdb::math::Floor(p.x()), openvdb::math::Floor(p.y()), openvdb::math::Floor(p.z())) >>
               static_cast<int>(Leaf::LOG2DIM);
    };
    return {leaf_of(place - reach), leaf_of(place + reach)};
}

}  // namespace

openvdb::FloatGrid::Ptr part_around(const openvdb::FloatGrid& grid, const std::vector<Vec3>& places,
                                    const Vec3& reach) {
    const auto leaves = static_cast<double>(grid.tree().leafCount());
    double looks = 0.0;
    for (const Vec3& place : places) looks += static_cast<double>(leaves_around(place, reach).volume());
    if (looks > kMostLooks * leaves) return nullptr;
    std::vector<Coord> around;
    around.reserve(static_cast<std::size_t>(looks));
    for (const Vec3& place : places)
        for (auto leaf = leaves_around(place, reach).begin(); leaf; ++leaf) around.push_back(*leaf);
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
        } else if (const float value = from.getValue(origin); value < 0.0f) {
            part->tree().addTile(1, origin, value, false);
        }
    }
    return part;
}

}  // namespace isotrack
