#include "tracking/lost_drops.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "surface/float_precision.h"

namespace isotrack {
namespace {

constexpr double kLeastFraction = 1e-3;             // of an edge
constexpr double kSizes[] = {1.0, 0.3, 0.1, 0.03};  // tried one after the other

using Node = std::array<int, 3>;

/// The dual mesh of the boundary of some lattice nodes: a quadrangle, split, for every edge that leaves them.
/// Its crossing is taken to be so much nearer, `size`, to the node.
TriangleMesh dual_mesh(const std::set<Node>& nodes, double size, const Surface& surface) {
    const Eigen::Affine3d lattice = surface.lattice();
    const auto probe = surface.probe();
    const auto place = [](const Node& n) { return Vec3(n[0], n[1], n[2]); };
    struct Cell {
        int vertex, crossings;
    };
    std::map<Node, Cell> cells;  // by their lowest corner
    TriangleMesh result;
    const auto vertex_of = [&](const Node& cell, const Vec3& crossing) {
        const auto found = cells.try_emplace(cell, Cell{static_cast<int>(result.points.size()), 0}).first;
        if (found->second.crossings++ == 0) result.points.emplace_back(Vec3::Zero());
        result.points[found->second.vertex] += crossing;
        return found->second.vertex;
    };
    for (const Node& inside : nodes)
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1}) {
                Node outside = inside;
                outside[axis] += step;
                if (nodes.count(outside) > 0) continue;
                const double a = probe->value(lattice * place(inside)),
                             b = probe->value(lattice * place(outside));
                const double fraction = a < 0.0 && b > a ? a / (a - b) : 0.0;
                const Vec3 crossing = lattice * (place(inside) + size * std::max(fraction, kLeastFraction) *
                                                                     (place(outside) - place(inside)));
                Node corner = inside;
                corner[axis] = std::min(inside[axis], outside[axis]);
                const int u = (axis + 1) % 3, w = (axis + 2) % 3;
                int around[4];  // counter-clockwise seen from the axis' upper end
                for (int k = 0; k < 4; ++k) {
                    Node cell = corner;
                    cell[u] -= k == 1 || k == 2;
                    cell[w] -= k == 2 || k == 3;
                    around[k] = vertex_of(cell, crossing);
                }
                if (step < 0) std::swap(around[1], around[3]);
                result.triangles.push_back({around[0], around[1], around[2]});
                result.triangles.push_back({around[0], around[2], around[3]});
            }
    for (const auto& [corner, cell] : cells)
        result.points[cell.vertex] = to_float_precision(result.points[cell.vertex] / cell.crossings);
    if (lattice.linear().determinant() < 0.0)
        for (Triangle& t : result.triangles) std::swap(t[1], t[2]);
    return result;
}

bool is_sphere(const TriangleMesh& mesh) {
    const MeshTopology topology = mesh_topology(mesh);
    return topology.closed() && topology.oriented() && topology.manifold() && topology.components == 1 &&
           topology.euler == 2 && self_intersections(mesh).empty() &&
           std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
               const Vec3 &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
               return (b - a).cross(c - a).norm() > 0.0;
           });
}

/// Not where it would cross the mesh or is no sphere. Returns whether it did.
bool put_in(TriangleMesh drop, FrameMesh& mesh) {
    if (!is_sphere(drop)) return false;
    const std::size_t first = mesh.vertices.size();
    for (Triangle& t : drop.triangles)
        for (int& v : t) v += static_cast<int>(first);
    mesh.vertices.insert(mesh.vertices.end(), drop.points.begin(), drop.points.end());
    const bool crosses = any_cross(mesh.vertices, drop.triangles, mesh.carved.triangles);
    mesh.vertices.resize(first);
    if (!crosses) append(mesh, drop.points, drop.triangles);
    return !crosses;
}

}  // namespace

bool put_in_drops(const std::vector<std::vector<Vec3>>& nodes, FrameMesh& mesh, Inspection& inspection,
                  Inspector& inspector, const Surface& surface) {
    const Eigen::Affine3d to_lattice = surface.lattice().inverse();
    bool any = false;
    for (const std::vector<Vec3>& component : nodes) {
        std::set<Node> of_lattice;
        for (const Vec3& p : component) {
            const Vec3 n = (to_lattice * p).array().round();
            of_lattice.insert({static_cast<int>(n.x()), static_cast<int>(n.y()), static_cast<int>(n.z())});
        }
        any = std::any_of(std::begin(kSizes), std::end(kSizes),
                          [&](double size) { return put_in(dual_mesh(of_lattice, size, surface), mesh); }) ||
              any;
    }
    if (any) inspection = inspector.inspect_both_ways(mesh);
    return any;
}

}  // namespace isotrack
