// Drops of a frame's surface that its mesh has nothing of.
#pragma once

#include <vector>

#include "tracking/inspection.h"

namespace isotrack {

/// Puts small closed meshes into a mesh around `nodes` of the lattice: each a component of inside nodes,
/// world positions, that it has no part of. One vertex for each cell in the mean of its crossings, which are
/// taken to be a thousandth of an edge from the node at least, and nearer by up to thirty times where the
/// drop would cross the mesh otherwise; they stand on no particle. Left out is what would cross it anyway or
/// would not be a sphere. Returns whether any was put in; `inspection` is that of the new mesh then, without
/// the topology.
bool put_in_drops(const std::vector<std::vector<Vec3>>& nodes, FrameMesh& mesh, Inspection& inspection,
                  Inspector& inspector, const Surface& surface);

}  // namespace isotrack
