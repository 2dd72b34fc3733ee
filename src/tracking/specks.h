// Components of a frame's mesh that the lattice of its surface does not have.
#pragma once

#include <functional>

#include "isotrack/sampling/particles.h"
#include "tracking/mesh_trials.h"

namespace isotrack {

/// The mesh of labels, which may change.
using Carve = std::function<FrameMesh(CellLabels&)>;

/// Joins specks that are needed, because they are near to what would be missed without them, with another
/// part of the mesh: by cells on the way to its next inside cell on which the outside ones go least far
/// outside, and no farther than the tolerance. That is wanted where it makes one component of two. Looks at
/// a few specks per call; the topology of `trials` is known afterwards. `labels`: those that the mesh was
/// carved from. Returns how many were joined.
std::size_t join_specks(MeshTrials& trials, CellLabels& labels, const Carve& carve, const Tetrahedra& cells,
                        const Particles& particles, const Surface& surface, const SizingLimits& limits);

/// Takes specks off a mesh, but for those that are needed. `inspection`: with what lies between crossings and
/// the topology, which it is without afterwards.
void remove_specks(FrameMesh& mesh, Inspection& inspection, Inspector& inspector, const SizingLimits& limits);

}  // namespace isotrack
