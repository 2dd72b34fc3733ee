// The components of the surface that crosses lattice edges.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>

#include "surface/crossed_edges.h"

namespace isotrack {

/// How many there are: edges hang together across faces of the lattice, ambiguous ones joined as volumeToMesh
/// joins them. `crossed`: those of `tree`. Uses TBB inside.
std::size_t count_components(const CrossedEdges& crossed, const openvdb::FloatTree& tree);

}  // namespace isotrack
