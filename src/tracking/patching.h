// What all ways to patch a frame's mesh have in common.
#pragma once

#include <limits>
#include <vector>

#include "meshing/patch.h"
#include "tracking/frame_mesh.h"

namespace isotrack {

/// Those of some places that are not near to one before; of very many the first.
std::vector<Vec3> apart(const std::vector<Vec3>& places, double distance,
                        std::size_t most = std::numeric_limits<std::size_t>::max());

/// The mesh with patches that have no vertex in common. What they bring is behind the rest, in their order.
FrameMesh patched(FrameMesh mesh, const std::vector<const Patch*>& patches);

/// The corners of the triangles of a patch, three for each.
std::vector<Vec3> corners_of(const Patch& patch, const FrameMesh& mesh);

/// Whether a triangle has hardly any area, as where the surface passes through a lattice node. Three corners
/// for each.
bool has_flat_triangle(const std::vector<Vec3>& corners);

/// Of a closed mesh; for a tenth of the price of its topology.
struct MeshNumbers {
    long components, euler;
    bool operator==(const MeshNumbers& o) const { return components == o.components && euler == o.euler; }
};
MeshNumbers numbers_of(const FrameMesh& mesh);

}  // namespace isotrack
