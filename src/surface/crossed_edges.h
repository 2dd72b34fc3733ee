// The lattice edges of a grid that cross its surface.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <utility>
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

/// In six bytes each, as there are many, leaf by leaf in the order of the tree. Read-only, so threads may
/// share them.
class CrossedEdges {
public:
    /// Those found from one leaf.
    struct Part {
        openvdb::Coord origin;  ///< Of the leaf.
        std::size_t begin, end;
    };

    std::size_t size() const { return fractions_.size(); }
    bool empty() const { return fractions_.empty(); }
    /// In a few steps, which `for_each_in` takes once and `for_each_of` not at all.
    CrossedEdge operator[](std::size_t i) const { return unpacked(i, parts_[part_of(i)].origin); }
    /// Calls `visit(edge)` for each from `first` on, up to `end`.
    template <typename Visit>
    void for_each_in(std::size_t first, std::size_t end, const Visit& visit) const {
        if (first >= end) return;
        for (std::size_t part = part_of(first); first < end; ++part)
            for (const std::size_t stop = std::min(end, parts_[part].end); first < stop; ++first)
                visit(unpacked(first, parts_[part].origin));
    }
    const std::vector<Part>& parts() const { return parts_; }
    /// Calls `visit(index, edge)` for each of a part.
    template <typename Visit>
    void for_each_of(const Part& part, const Visit& visit) const {
        for (std::size_t i = part.begin; i < part.end; ++i) visit(i, unpacked(i, part.origin));
    }

    bool finite() const { return finite_; }               ///< Whether all values of leaves are.
    long cell_parts() const { return cell_parts_; }       ///< Of all leaves: see cell_parts.h.
    std::size_t at_border() const { return at_border_; }  ///< So many of the edges are.

private:
    friend CrossedEdges find_crossed_edges(const openvdb::FloatTree& tree);

    /// All but the fraction. The lower end is a node of the leaf, or one step below it along the edge's axis.
    class Code {
    public:
        Code() = default;
        Code(const CrossedEdge& edge, const openvdb::Coord& origin) {
            openvdb::Coord in_leaf = edge.from - origin;
            int axis = edge.axis;
            assert(in_leaf[axis] >= -1);
            if (in_leaf[axis] < 0) {
                in_leaf[axis] = axis;
                std::swap(in_leaf[axis], in_leaf[0]);
                axis = kBelow;
            }
            assert(((in_leaf[0] | in_leaf[1] | in_leaf[2]) & ~7) == 0);
            bits_ = static_cast<std::uint16_t>(in_leaf[0] << 13 | in_leaf[1] << 10 | in_leaf[2] << 7 |
                                               axis << 5 | edge.saddles << 2 | edge.at_border << 1 |
                                               static_cast<int>(edge.outward));
        }
        CrossedEdge edge(const openvdb::Coord& origin, float fraction) const {
            openvdb::Coord in_leaf(bits_ >> 13, bits_ >> 10 & 7, bits_ >> 7 & 7);
            int axis = bits_ >> 5 & 3;
            if (axis == kBelow) {
                axis = in_leaf[0];
                in_leaf[0] = -1;
                std::swap(in_leaf[axis], in_leaf[0]);
            }
            return {origin + in_leaf,
                    fraction,
                    static_cast<std::int8_t>(axis),
                    (bits_ & 1) != 0,
                    (bits_ >> 1 & 1) != 0,
                    static_cast<std::uint8_t>(bits_ >> 2 & 7)};
        }

    private:
        static_assert(openvdb::FloatTree::LeafNodeType::LOG2DIM == 3);
        static constexpr int kBelow = 3;  // for the axis, which is then in the place of the first coordinate

        std::uint16_t bits_;  // from the highest: lower end in the leaf, axis, saddles, at_border, outward
    };
    static_assert(sizeof(Code) == 2);
    CrossedEdge unpacked(std::size_t i, const openvdb::Coord& origin) const {
        return codes_[i].edge(origin, fractions_[i]);
    }
    std::size_t part_of(std::size_t i) const {
        std::size_t part = part_at_[i / kStep];
        while (parts_[part].end <= i) ++part;
        return part;
    }
    static constexpr std::size_t kStep = 64;

    UnsetVector<float> fractions_;
    UnsetVector<Code> codes_;
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
