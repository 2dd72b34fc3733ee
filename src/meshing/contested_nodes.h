// Where the sides of lattice nodes that a mesh has and those that its surface has differ enough to matter.
#pragma once

#include <array>
#include <vector>

#include "isotrack/meshing/lattice_topology.h"

namespace isotrack {

using Node = std::array<int, 3>;

struct Contested {
    /// Nodes on the wrong side of the mesh; ascending. Left out are those between mesh and surface where both
    /// cross a line and its eight neighbours in step, and nothing that faces the other way is near: there the
    /// two are the graphs of functions over the same lines, and their nodes can be put right in any order,
    /// each a simple point.
    std::vector<Node> nodes;
    /// Per component: it holds a node on its own and is not torn off others. The mesh is taken to consist of
    /// those that do and are not.
    std::vector<char> is_part;
};

/// `points` in lattice units; `component` per triangle, below `components`.
Contested contested_nodes(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                          const std::vector<int>& component, int components, const LatticeSides& sides);

}  // namespace isotrack
