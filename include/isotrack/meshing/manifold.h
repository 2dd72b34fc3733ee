// From labelled cells to a closed oriented 2-manifold.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/meshing/convection.h"

namespace isotrack {

/// The boundary of the inside cells. Its triangles are facets of the DT, so they meet only in common vertices
/// and edges.
struct CarvedSurface {
    std::vector<Triangle> triangles;  ///< Output vertices, counter-clockwise seen from outside.
    /// Per output vertex: the particle it stands on; -1 for an edge midpoint, and in what was put in.
    std::vector<int> particle;
    std::vector<Vec3>
        midpoints;  ///< Positions of the output vertices that stand on no particle: the last ones, in order.
    static constexpr int kNoFacet = -1;
    /// Per triangle: which facet of the cell behind it it is, as `Tetrahedra::link`. Midpoints split a
    /// triangle, both halves keep its facet, and one that is flipped keeps the facet in whose place it is.
    /// kNoFacet: it came later.
    std::vector<int> facet;
    /// That cell; negative if it came later.
    int inside_cell(std::size_t triangle) const { return facet[triangle] >> 2; }
    /// The index of that cell's vertex opposite the facet; without meaning if it came later.
    int inside_facet(std::size_t triangle) const { return facet[triangle] & 3; }

    struct Edge {
        int from, to;  ///< Particles.
        int cell;      ///< An inside cell that has both.
    };
    std::vector<Edge> complex_edges;  ///< Edges of the DT with four or more boundary facets.
    struct Pinch {
        int particle, cell;  ///< An inside cell that has it.
    };
    std::vector<Pinch> pinched;  ///< Particles that needed more than one output vertex, ascending.
};

/// Every half-edge is mated with the one found by rotating through inside cells, so solids that touch stay
/// apart; the corners that mates join form cycles, and each cycle becomes one output vertex [Guéziec et al.
/// 2001, "Cutting and stitching", in a DT where the rotation is at hand]. Output vertices with particle index
/// p come first, in the order of the particles, further copies after them. Where two different edges still
/// join the same two output vertices, one of them is split at its midpoint. Always closed, oriented and
/// manifold.
CarvedSurface carve(const Tetrahedra& cells, const CellLabels& labels, const std::vector<Vec3>& points);

}  // namespace isotrack
