// The components of the surface that crosses lattice edges.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <vector>

#include "isotrack/types.h"
#include "surface/affine_map.h"

namespace isotrack {

/// How many there are: edges of which one end is inside hang together across faces of the lattice, ambiguous
/// ones joined as volumeToMesh joins them. Edges between two tiles are not seen. Uses TBB inside.
std::size_t count_components(const openvdb::FloatTree& tree);

/// They themselves, each by the box of its crossings in the world, ascending by their lowest corners. Takes
/// about half as long again. Uses TBB inside; same result at any thread count.
std::vector<Box> boxes_of_components(const openvdb::FloatTree& tree, const AffineMap& map);

}  // namespace isotrack
