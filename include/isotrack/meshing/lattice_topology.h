// Whether a mesh has the topology that the signs at the lattice nodes have.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "isotrack/surface/surface.h"
#include "isotrack/types.h"

namespace isotrack {

/// How the topology of a mesh differs from that of the set of inside lattice nodes (26-connected; the outside
/// is 6-connected), which is that of volumeToMesh.
struct LatticeTopology {
    /// Nodes on the wrong side of the mesh whose side matters. The other wrong nodes, within the tolerance,
    /// can be put right one after the other, each a simple point, so that they change no component, handle or
    /// void. Also all nodes of a component that volumeToMesh parts from others it touches across an edge or a
    /// corner, where the mesh has none of them. World positions, in the order of the nodes.
    std::vector<Vec3> faults;
    /// The nodes of the latter, component by component. World positions.
    std::vector<std::vector<Vec3>> lost;
    /// Diagonals of the surface that the mesh crosses twice or more often: it parts what they join.
    std::vector<Surface::Diagonal> parted;
    /// Per triangle: it belongs to a component that volumeToMesh does not have. It holds no node on its own;
    /// or it is no more than four voxels large, and an inside node of it is joined there with one that the
    /// rest holds.
    std::vector<char> speck;
};

/// The crossed edges along the lattice's third axis, each from its lower node (x, y, z): in layers of one x,
/// ascending there in y and z.
class Uprights {
public:
    struct Node {
        int y, z;
    };
    using Range = std::pair<const Node*, const Node*>;

    Uprights() = default;
    /// From lower nodes in any order.
    explicit Uprights(const std::vector<Eigen::Vector3i>& nodes);

    /// The layers from `low_x()` up to, but not including, `end_x()` may hold some.
    int low_x() const { return low_x_; }
    int end_x() const { return low_x_ + static_cast<int>(first_.size()) - 1; }
    bool empty() const { return nodes_.empty(); }
    Range layer(int x) const {
        if (x < low_x() || x >= end_x()) return {nullptr, nullptr};
        const auto at = static_cast<std::size_t>(x - low_x_);
        return {nodes_.data() + first_[at], nodes_.data() + first_[at + 1]};
    }
    /// Those of one line.
    Range line(int x, int y) const;

private:
    int low_x_ = 0;
    std::vector<Node> nodes_;
    std::vector<std::size_t> first_ = {0};  // of each layer, and the end
};

/// The sides of the lattice nodes of a surface, to hold meshes of it against. Read-only, so threads may share
/// it.
class LatticeSides {
public:
    /// `surface` must outlive this.
    explicit LatticeSides(const Surface& surface);

    const Surface& surface() const { return surface_; }
    /// The surface's, ascending in the least x of their nodes.
    const std::vector<Surface::Diagonal>& diagonals() const { return diagonals_; }
    const Uprights& uprights() const { return uprights_; }

private:
    const Surface& surface_;
    std::vector<Surface::Diagonal> diagonals_;
    Uprights uprights_;
};

/// The mesh must be closed. Nodes count as on the side of the mesh that the lattice line in the third
/// direction through them says.
LatticeTopology lattice_topology(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                 const LatticeSides& sides);

}  // namespace isotrack
