// The components of the surface that crosses lattice edges.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>

namespace isotrack {

/// How many there are: edges of which one end is inside hang together across faces of the lattice, ambiguous
/// ones joined as volumeToMesh joins them. Edges between two tiles are not seen. Uses TBB inside.
std::size_t count_components(const openvdb::FloatTree& tree);

}  // namespace isotrack
