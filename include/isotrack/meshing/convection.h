// Which cells of the Delaunay tetrahedralisation are solid: the result of the convection front.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// One flag per cell: 1 inside the solid, 0 outside. Infinite cells are outside.
using CellLabels = std::vector<char>;

/// The convection front of Chaine 2003, guided by the surface.
///
/// Pure convection carves a cell when its circumcentre lies on the outer side of the facet it was reached by:
/// the front follows the flow of the distance to the particles. It starts at the hull, so it never enters a
/// void and welds what nearly touches. With the sign of the level set known everywhere, the front may instead
/// start at every outside cell, be vetoed by inside ones and forced through outside ones; its result is then
/// the boundary of the labels themselves, whatever the order of the queue. So the labels are computed
/// directly, in parallel:
/// - a cell whose vertices all face the same way (every n_a . n_b >= 0) spans one sheet: it is inside when
///   its circumcentre is, which is the rule of convection and of the restricted Delaunay triangulation, and
///   is coherent among the slivers that lie on the sheet;
/// - any other cell spans two sheets, a thin solid or a gap, where the circumcentre may lie beyond the far
///   sheet: it is inside when its centroid is. So is a cell where the gradient is short, since sheets less
///   than a voxel apart blur each other's normals (but not beyond the band of a grid, where there is no
///   gradient), and one with its centroid a detail or more from the surface, which no sliver on a sheet has.
/// A cell too flat to have a circumcentre takes the label of the cell it flows to. `detail`: what is smaller
/// need not be seen, the surface's resolution or more, as that when unset.
CellLabels guided_convection(const Tetrahedra& cells, const std::vector<Vec3>& points,
                             const std::vector<Vec3>& normals, const Surface& surface,
                             std::optional<double> detail = {});

/// The same for the slots in `changed` alone, in `labels`, which grows to one entry per slot.
void update_labels(CellLabels& labels, const std::vector<int>& changed, const Tetrahedra& cells,
                   const std::vector<Vec3>& points, const std::vector<Vec3>& normals, const Surface& surface,
                   std::optional<double> detail = {});

/// The paper's reconstruction: the particles alone, from the hull inwards, by the exact oriented Gabriel
/// test. Voids stay filled.
CellLabels pure_convection(const Tetrahedra& cells, const std::vector<Vec3>& points);

}  // namespace isotrack
