// How many parts a surface has in the cells of its lattice.
#pragma once

#include "surface/leaf_sides.h"

namespace isotrack {

/// The sum over the cells that belong to a leaf, every cell of mixed sides to one: how many vertices
/// volumeToMesh puts into them at 0. Where a tile and another are on different sides is not seen.
long cell_parts(const openvdb::FloatTree::LeafNodeType& leaf, const LeafSides& sides, TreeReader& reader);

}  // namespace isotrack
