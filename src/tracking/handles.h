// Handles of a frame's mesh that the lattice of its surface does not have.
#pragma once

#include <functional>
#include <vector>

#include "isotrack/meshing/convection.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"
#include "tracking/inspection.h"

namespace isotrack {

/// For the last mesh of a frame, on a surface that knows its `lattice_euler`. Two sheets nearer to each other
/// than the lattice resolves may be joined by a bridge, or have a hole, between its lines, where no node and
/// no crossing tells. While the mesh has an Euler number below the lattice's: around small handles at such
/// sheets the cells between both, as far as their centroids are near the surface, change sides together, the
/// outside ones or the inside ones, nearer ones first alone. That stays where the mesh has a handle less
/// then, and as many components, no more crossings are missed and no more nodes on a wrong side than before,
/// and the largest error is within the tolerance or no larger. `thickness`: per particle, the distance to the
/// next sheet. `carve_labels` may change them; `fit` fits what it carved. Looks at a few places per call.
/// Returns how many were mended.
std::size_t mend_handles(CellLabels& labels, const Tetrahedra& cells, FrameMesh& mesh, Inspection& inspection,
                         Inspector& inspector, const Particles& particles,
                         const std::vector<double>& thickness, const Surface& surface,
                         const SizingLimits& limits,
                         const std::function<FrameMesh(CellLabels&)>& carve_labels,
                         const std::function<void(FrameMesh&)>& fit);

}  // namespace isotrack
