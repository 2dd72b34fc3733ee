// Components of a frame's mesh that the lattice of its surface does not have.
#pragma once

#include "isotrack/sampling/particles.h"
#include "tracking/label_trials.h"

namespace isotrack {

/// Joins specks that are needed, because without them more would be missed, with the rest of the mesh: by
/// cells on the way to its next inside cell, that way on which the outside ones go least far outside, and no
/// farther than the tolerance. That is wanted where it makes one component of two. Returns how many were
/// joined.
std::size_t join_specks(LabelTrials& trials, const Tetrahedra& cells, const Particles& particles,
                        const Surface& surface, const SizingLimits& limits);

/// Takes specks off the mesh just inspected, but for those that are needed.
void remove_specks(FrameMesh& mesh, Inspection& inspection, Inspector& inspector, const SizingLimits& limits);

}  // namespace isotrack
