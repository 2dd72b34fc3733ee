// Handles of a frame's mesh that the lattice of its surface does not have.
#pragma once

#include <vector>

#include "isotrack/sampling/particles.h"
#include "tracking/label_trials.h"

namespace isotrack {

/// For a surface that knows its `lattice_euler`. Two sheets nearer to each other than the lattice resolves
/// may be joined by a bridge, or have a hole, between its lines, where no node and no crossing tells. While
/// the mesh has an Euler number below the lattice's: around small handles at such sheets the cells between
/// both, as far as their centroids are near the surface, change sides together, the outside ones or the
/// inside ones, nearer ones first alone. That is wanted where the mesh has a handle less then, and as many
/// components. `thickness`: per particle, the distance to the next sheet. Looks at a few places per call.
/// Returns how many were mended.
std::size_t mend_handles(LabelTrials& trials, const Tetrahedra& cells, const Particles& particles,
                         const std::vector<double>& thickness, const Surface& surface);

}  // namespace isotrack
