// Where a mesh may miss the surface between lattice crossings although it reaches them.
#pragma once

#include <vector>

#include "isotrack/meshing/manifold.h"
#include "surface/cell_points.h"
#include "tracking/mesh_distances.h"

namespace isotrack {

class BetweenCrossings {
public:
    /// `crossings`: all of `lattice`, none that stands for others. They must outlive it. `diagonals`: all of
    /// the surface.
    BetweenCrossings(const CrossingGrid& crossings, const Eigen::Affine3d& lattice,
                     const std::vector<Surface::Diagonal>& diagonals, double tolerance)
        : crossings_(crossings), tolerance_(tolerance), cells_(crossings, lattice, diagonals) {}

    /// Points of the surface in the cells beside crossings that the mesh only just reaches, along its folds
    /// beside nearly all, since from a fold what lies between two crossings may be much farther than either,
    /// and in all cells with an ambiguous face. What was returned before is left out.
    std::vector<Surface::Crossing> points(const std::vector<Vec3>& vertices,
                                          const std::vector<Triangle>& triangles,
                                          const MeshDistances& at_crossings);

private:
    const CrossingGrid& crossings_;
    const double tolerance_;
    CellPoints cells_;
    std::vector<char> looked_at_;  // per crossing
};

}  // namespace isotrack
