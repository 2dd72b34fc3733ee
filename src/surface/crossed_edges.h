// The lattice edges of a grid that cross its surface.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// From `from`, `fraction` of a voxel along `axis`.
struct CrossedEdge {
    openvdb::Coord from;
    float fraction;
    std::int8_t axis;
    bool outward;    ///< `from` is the end inside.
    bool at_border;  ///< One end is an inactive voxel.
    /// A bit for each axis above its own: the face that it spans with one step along that axis may have its
    /// two inside nodes across a diagonal. Of faces within a leaf it is known, of others not looked at.
    std::uint8_t saddles;

    Vec3 index() const {
        Vec3 p(from.x(), from.y(), from.z());
        p[axis] += fraction;
        return p;
    }
};

struct CrossedEdges {
    /// Those found from one leaf.
    struct Part {
        openvdb::Coord origin;  ///< Of the leaf.
        std::size_t begin, end;
    };
    std::vector<CrossedEdge> edges;
    std::vector<Part> parts;  ///< One after the other, in the order of the tree.
    long cell_parts = 0;      ///< Of all leaves: see cell_parts.h.
};

/// Every edge with a sign change; values must be finite. Edges between two tiles are not seen: a level set
/// has voxels at its surface.
CrossedEdges find_crossed_edges(const openvdb::FloatTree& tree);

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
