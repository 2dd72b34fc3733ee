// Of the crossed edges of a lattice some: that stand for all, or that are near places.
#pragma once

#include <cstddef>
#include <vector>

#include "surface/crossed_edges.h"

namespace isotrack {

/// One that stands for others around it.
struct StandIn {
    std::size_t edge;  ///< Its index.
    int stands_for;    ///< So many, itself among them.
    bool flat;         ///< The surface is a flat sheet there.
};

/// Some that stand for all. In each cube of `wide` voxels where the edges go one way along each axis, so that
/// there is no rim and no second sheet, and the surface lies between two planes 0.16 of its edge apart: those
/// at its four corners. Elsewhere in each cube of `cube` voxels, along the axis that most of its edges
/// follow, one that goes out and one that goes in. Both are powers of two, `cube` at most 8, `wide` no less.
std::vector<StandIn> thin_out(const CrossedEdges& crossed, int cube, int wide);

/// Indices of all in those of the cubes that boxes around some places meet, `reach` to each side. In voxels.
std::vector<std::size_t> edges_near(const CrossedEdges& crossed, const std::vector<Vec3>& places,
                                    double reach, int cube);

}  // namespace isotrack
