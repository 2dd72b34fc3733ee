// Cells that a failing mesh shows to have the wrong label.
#pragma once

#include "isotrack/meshing/convection.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"
#include "tracking/inspection.h"

namespace isotrack {

/// For when nothing can be added any more that would break a triangle too far from the surface, such as that
/// of a flat cell across a bay in the rim of a thin sheet: the cell on its wrong side, behind it when it is
/// outside, else in front of it, changes sides, unless its centroid is clearly where its label says. Returns
/// how many changed.
std::size_t relabel(CellLabels& labels, const Tetrahedra& cells, const FrameMesh& mesh,
                    const Inspection& inspection, const Particles& particles, const Surface& surface,
                    const SizingLimits& limits);

}  // namespace isotrack
