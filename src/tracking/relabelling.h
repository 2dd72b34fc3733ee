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

/// For what is missed although a particle that no triangle has is there, such as the tip of a sheet that
/// labels cut off or a dent that they fill: the cell between it and a triangle of the mesh changes sides
/// where the three triangles to it that come instead are within the tolerance. That joins nothing and parts
/// nothing. Returns how many cells changed.
std::size_t reach_out(CellLabels& labels, const Tetrahedra& cells, const FrameMesh& mesh,
                      const Inspection& inspection, const Particles& particles, const Surface& surface,
                      const SizingLimits& limits);

}  // namespace isotrack
