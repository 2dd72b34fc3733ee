// The lattice edges of a grid that cross its surface.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "isotrack/types.h"
#include "unset_vector.h"

namespace isotrack {

/// From `from`, `fraction` of a voxel along `axis`.
struct CrossedEdge {
    openvdb::Coord from;
    float fraction;
    std::int8_t axis;
    bool outward;    ///< `from` is the end inside.
    bool at_border;  ///< One end is an inactive voxel.
    /// A bit for each axis above its own, set where the face that it spans with one step along that axis has
    /// its two inside nodes across a diagonal. All are where `from` is in a tile: there it is not known.
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
    bool finite = true;  ///< Whether all values of leaves are.
    UnsetVector<CrossedEdge> edges;
    std::vector<Part> parts;    ///< One after the other, in the order of the tree.
    long cell_parts = 0;        ///< Of all leaves: see cell_parts.h.
    std::size_t at_border = 0;  ///< So many of the edges are.
};

/// Every edge with a sign change; nothing where a value of a leaf is not finite. Edges between two tiles are
/// not seen: a level set has voxels at its surface.
CrossedEdges find_crossed_edges(const openvdb::FloatTree& tree);

}  // namespace isotrack
