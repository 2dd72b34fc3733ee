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

/// Packed, as there are many, leaf by leaf in the order of the tree. Read-only, so threads may share them.
class CrossedEdges {
public:
    /// Those found from one leaf.
    struct Part {
        openvdb::Coord origin;  ///< Of the leaf.
        std::size_t begin, end;
    };

    std::size_t size() const { return packed_.size(); }
    bool empty() const { return packed_.empty(); }
    /// In a few steps; `for_each_of` takes none.
    CrossedEdge operator[](std::size_t i) const {
        std::size_t part = part_at_[i / kStep];
        while (parts_[part].end <= i) ++part;
        return packed_[i].unpack(parts_[part].origin);
    }
    const std::vector<Part>& parts() const { return parts_; }
    /// Calls `visit(index, edge)` for each of a part.
    template <typename Visit>
    void for_each_of(const Part& part, const Visit& visit) const {
        for (std::size_t i = part.begin; i < part.end; ++i) visit(i, packed_[i].unpack(part.origin));
    }

    bool finite() const { return finite_; }               ///< Whether all values of leaves are.
    long cell_parts() const { return cell_parts_; }       ///< Of all leaves: see cell_parts.h.
    std::size_t at_border() const { return at_border_; }  ///< So many of the edges are.

private:
    friend CrossedEdges find_crossed_edges(const openvdb::FloatTree& tree);

    /// Its lower end is a node of the leaf or one step below it.
    struct Packed {
        float fraction;
        std::uint32_t x : 4, y : 4, z : 4;  // of the lower end, counted from one step below the leaf
        std::uint32_t axis : 2, outward : 1, at_border : 1, saddles : 3;

        Packed(const CrossedEdge& edge, const openvdb::Coord& origin)
            : fraction(edge.fraction),
              x(static_cast<std::uint32_t>(edge.from.x() - origin.x() + 1)),
              y(static_cast<std::uint32_t>(edge.from.y() - origin.y() + 1)),
              z(static_cast<std::uint32_t>(edge.from.z() - origin.z() + 1)),
              axis(static_cast<std::uint32_t>(edge.axis)),
              outward(edge.outward),
              at_border(edge.at_border),
              saddles(edge.saddles) {}
        CrossedEdge unpack(const openvdb::Coord& origin) const {
            const auto in_leaf = [](std::uint32_t stored) { return static_cast<int>(stored) - 1; };
            return {origin.offsetBy(in_leaf(x), in_leaf(y), in_leaf(z)),
                    fraction,
                    static_cast<std::int8_t>(axis),
                    outward != 0,
                    at_border != 0,
                    static_cast<std::uint8_t>(saddles)};
        }
    };
    static_assert(sizeof(Packed) == 8);
    static constexpr std::size_t kStep = 64;

    UnsetVector<Packed> packed_;
    std::vector<Part> parts_;             // one after the other, none empty
    std::vector<std::uint32_t> part_at_;  // of every kStep-th edge
    bool finite_ = true;
    long cell_parts_ = 0;
    std::size_t at_border_ = 0;
};

/// Every edge with a sign change; nothing where a value of a leaf is not finite. Edges between two tiles are
/// not seen: a level set has voxels at its surface.
CrossedEdges find_crossed_edges(const openvdb::FloatTree& tree);

}  // namespace isotrack
