// Small components of a mesh that volumeToMesh joins with others.
#pragma once

#include <vector>

#include "isotrack/meshing/lattice_topology.h"
#include "meshing/mesh_lines.h"

namespace isotrack {

/// Those, no more than four voxels large and not within the rest, with an inside node that volumeToMesh joins
/// with one that the rest of the mesh holds, directly or through a few that the rest does not hold. The
/// smallest are looked at first, and are not of the rest once they are found: of parts that are torn from
/// nothing but each other one is left. `lines`: of the mesh; `points` in lattice units, `component` per
/// triangle. The mesh is taken to consist of the components whose flag in `is_part` is set. Uses
/// TBB inside; the same at any thread count.
std::vector<int> torn_components(const MeshLines& lines, const std::vector<Vec3>& points,
                                 const std::vector<Triangle>& triangles, const std::vector<int>& component,
                                 const std::vector<char>& is_part, const LatticeSides& sides);

}  // namespace isotrack
