// The border of a grid left open instead of closed by a cap.
#pragma once

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Takes the triangles off whose three vertices all lie at the border (`at_border`, one flag per vertex):
/// those of the cap, and of the rim within a lattice cell of it. A triangle with a vertex elsewhere stays, so
/// no hole reaches further. Vertices that are then unused go; one whose triangles fall into several fans is
/// copied, the first fan keeps its id and the copies take ids from `next_id`. What is left is oriented and
/// manifold, with border edges where triangles went. Returns how many went.
std::size_t open_border(TriangleMesh& mesh, const std::vector<char>& at_border, Id& next_id);

}  // namespace isotrack
