#include "surface/lattice_mesh.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "parallel_for_each.h"
#include "surface/float_precision.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr std::size_t kGrain = 1024;

/// Where the lattice edge that the four cells around are common to crosses the surface. `cells`: their
/// lowest corners. nullopt where they are not around an edge that does.
std::optional<Vec3> crossing_amid(const Vec3 (&cells)[4], const Eigen::Affine3d& lattice, double resolution,
                                  Surface::Probe& probe) {
    const Vec3 low = cells[0].cwiseMin(cells[1]).cwiseMin(cells[2]).cwiseMin(cells[3]),
               high = cells[0].cwiseMax(cells[1]).cwiseMax(cells[2]).cwiseMax(cells[3]),
               middle = 0.25 * (cells[0] + cells[1] + cells[2] + cells[3]);
    int axis = -1;
    for (int k = 0; k < 3; ++k) {
        if (high[k] == low[k] && axis < 0)
            axis = k;
        else if (high[k] != low[k] + 1.0 || middle[k] != low[k] + 0.5)
            return std::nullopt;
    }
    if (axis < 0) return std::nullopt;
    const Vec3 from = lattice * high, to = lattice * Vec3(high + Vec3::Unit(axis));
    const double a = off_node(probe.value(from), resolution), b = off_node(probe.value(to), resolution);
    if ((a < 0.0) == (b < 0.0)) return std::nullopt;
    return from + a / (a - b) * (to - from);
}

/// Flags for the points that are not alone in their cell.
std::vector<char> share_cells(const std::vector<Vec3>& points, const Eigen::Affine3d& to_lattice) {
    std::vector<std::pair<std::array<int, 3>, int>> by_cell(points.size());
    parallel_for_each(points.size(), kGrain, [&](std::size_t p) {
        const Eigen::Array3i cell = (to_lattice * points[p]).array().floor().cast<int>();
        by_cell[p] = {{cell[0], cell[1], cell[2]}, static_cast<int>(p)};
    });
    tbb::parallel_sort(by_cell.begin(), by_cell.end());
    std::vector<char> result(points.size(), 0);
    for (std::size_t i = 1; i < by_cell.size(); ++i)
        if (by_cell[i].first == by_cell[i - 1].first)
            result[by_cell[i].second] = result[by_cell[i - 1].second] = 1;
    return result;
}

/// An edge of a quadrangle, between two cells.
struct CellEdge {
    int low, high;  // corners
    int quadrangle, k;
    bool operator<(const CellEdge& o) const {
        return std::tie(low, high, quadrangle, k) < std::tie(o.low, o.high, o.quadrangle, o.k);
    }
};

/// Ascending.
std::vector<CellEdge> cell_edges(const PolygonMesh& quadrangles) {
    const auto for_each_edge = [&](const auto& visit) {
        for (std::size_t q = 0; q < quadrangles.quads.size(); ++q)
            for (int k = 0; k < 4; ++k) {
                const int a = quadrangles.quads[q][k], b = quadrangles.quads[q][(k + 1) % 4];
                visit(CellEdge{std::min(a, b), std::max(a, b), static_cast<int>(q), k});
            }
    };
    // By their lower corners, at each of which there are few.
    std::vector<std::size_t> next(quadrangles.points.size() + 1, 0);
    for_each_edge([&](const CellEdge& edge) { ++next[edge.low + 1]; });
    std::partial_sum(next.begin(), next.end(), next.begin());
    std::vector<CellEdge> result(next.back());
    for_each_edge([&](const CellEdge& edge) { result[next[edge.low]++] = edge; });
    parallel_for_each(quadrangles.points.size(), kGrain, [&](std::size_t low) {
        const auto begin = static_cast<std::ptrdiff_t>(low > 0 ? next[low - 1] : 0);
        std::sort(result.begin() + begin, result.begin() + static_cast<std::ptrdiff_t>(next[low]));
    });
    return result;
}

}  // namespace

PolygonMesh quadrangles_near(const std::vector<Vec3>& places, double reach, const PolygonMesh& quadrangles) {
    std::vector<char> near(quadrangles.points.size());
    parallel_for_each(near.size(), kGrain, [&](std::size_t v) {
        near[v] = std::any_of(places.begin(), places.end(), [&](const Vec3& place) {
            return (quadrangles.points[v] - place).lpNorm<Eigen::Infinity>() <= reach;
        });
    });
    PolygonMesh result;
    std::vector<int> number(near.size(), -1);
    for (const auto& q : quadrangles.quads) {
        if (std::none_of(q.begin(), q.end(), [&](int v) { return near[v] != 0; })) continue;
        result.quads.push_back(q);
        for (int& v : result.quads.back()) {
            if (number[v] < 0) {
                number[v] = static_cast<int>(result.points.size());
                result.points.push_back(quadrangles.points[v]);
            }
            v = number[v];
        }
    }
    return result;
}

TriangleMesh lattice_mesh_of(const PolygonMesh& quadrangles, const Surface& surface) {
    const Eigen::Affine3d lattice = surface.lattice(), to_lattice = lattice.inverse();
    const auto cell_of = [&](const Vec3& p) -> Vec3 { return (to_lattice * p).array().floor(); };
    const auto& in_cell = quadrangles.points;
    const std::size_t cells = in_cell.size(), quads = quadrangles.quads.size();
    const std::vector<char> shares_cell = share_cells(in_cell, to_lattice);
    ThreadProbes probes(surface);
    TriangleMesh mesh;
    mesh.points = in_cell;
    mesh.points.resize(cells + quads);
    parallel_for_each(cells, kGrain, [&](std::size_t v) {
        if (shares_cell[v]) return;
        const auto p = probes.local().project(in_cell[v]);
        if (p && cell_of(*p) == cell_of(in_cell[v])) mesh.points[v] = *p;
    });
    parallel_for_each(quads, kGrain, [&](std::size_t q) {
        const auto& [i, j, k, l] = quadrangles.quads[q];
        mesh.points[cells + q] = crossing_amid({cell_of(in_cell[i]), cell_of(in_cell[j]), cell_of(in_cell[k]),
                                                cell_of(in_cell[l])},
                                               lattice, surface.resolution(), probes.local())
                                     .value_or(0.25 * (in_cell[i] + in_cell[j] + in_cell[k] + in_cell[l]));
    });
    // The two quadrangles of an edge are around crossings on one face of both cells; between these it passes.
    std::vector<std::array<int, 4>> on_face(quads);
    const std::vector<CellEdge> edges = cell_edges(quadrangles);
    for (std::size_t e = 0; e < edges.size(); ++e) {
        const CellEdge& one = edges[e];
        Vec3 middle = mesh.points[cells + one.quadrangle];
        on_face[one.quadrangle][one.k] = static_cast<int>(mesh.points.size());
        if (e + 1 < edges.size() && one.low == edges[e + 1].low && one.high == edges[e + 1].high) {
            const CellEdge& other = edges[++e];
            middle = 0.5 * (middle + mesh.points[cells + other.quadrangle]);
            on_face[other.quadrangle][other.k] = on_face[one.quadrangle][one.k];
        }
        mesh.points.push_back(middle);
    }
    mesh.triangles.reserve(8 * quads);
    for (std::size_t q = 0; q < quads; ++q)
        for (int k = 0; k < 4; ++k) {
            const int a = quadrangles.quads[q][k], b = quadrangles.quads[q][(k + 1) % 4], f = on_face[q][k],
                      crossing = static_cast<int>(cells + q);
            mesh.triangles.push_back({a, f, crossing});
            mesh.triangles.push_back({f, b, crossing});
        }
    for (Vec3& p : mesh.points) p = to_float_precision(p);
    return mesh;
}

}  // namespace isotrack
