// Small components of a mesh that volumeToMesh joins with others.
#pragma once

#include <vector>

#include "isotrack/meshing/lattice_topology.h"
#include "meshing/mesh_lines.h"

namespace isotrack {

/// Those, no more than a few voxels large, with an inside node that volumeToMesh joins with one that the rest
/// of the mesh holds, directly or through some that no part holds. The smallest are looked at first, and are
/// not of the rest once they are found: of parts that are torn from nothing but each other one is left.
/// `lines`: of the mesh; `points` in lattice units, `component` per triangle. Only components whose flag in
/// `looked_at` is set count at all.
std::vector<int> torn_components(const MeshLines& lines, const std::vector<Vec3>& points,
                                 const std::vector<Triangle>& triangles, const std::vector<int>& component,
                                 const std::vector<char>& looked_at, const LatticeSides& sides);

}  // namespace isotrack
