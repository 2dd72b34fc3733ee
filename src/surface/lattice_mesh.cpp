#include "surface/lattice_mesh.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "isotrack/meshing/self_intersections.h"
#include "meshing/triangle_distance.h"
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

namespace {

/// Quadrangles around crossed edges with all vertices that their triangles may have.
struct Pieces {
    /// Of the cells first, brought to the surface where they stay in their cells; then the crossing that each
    /// quadrangle is around, then those on faces between cells.
    std::vector<Vec3> points;
    std::vector<std::array<int, 4>> on_face;  // of each quadrangle: on its edge from corner k to the next

    Pieces(const PolygonMesh& quadrangles, const Surface& surface);
};

Pieces::Pieces(const PolygonMesh& quadrangles, const Surface& surface) : points(quadrangles.points) {
    const Eigen::Affine3d lattice = surface.lattice(), to_lattice = lattice.inverse();
    const auto cell_of = [&](const Vec3& p) -> Vec3 { return (to_lattice * p).array().floor(); };
    const auto& in_cell = quadrangles.points;
    const std::size_t cells = in_cell.size(), quads = quadrangles.quads.size();
    const std::vector<char> shares_cell = share_cells(in_cell, to_lattice);
    ThreadProbes probes(surface);
    points.resize(cells + quads);
    parallel_for_each(cells, kGrain, [&](std::size_t v) {
        if (shares_cell[v]) return;
        const auto p = probes.local().project(in_cell[v]);
        if (p && cell_of(*p) == cell_of(in_cell[v])) points[v] = *p;
    });
    parallel_for_each(quads, kGrain, [&](std::size_t q) {
        const auto& [i, j, k, l] = quadrangles.quads[q];
        points[cells + q] = crossing_amid({cell_of(in_cell[i]), cell_of(in_cell[j]), cell_of(in_cell[k]),
                                           cell_of(in_cell[l])},
                                          lattice, surface.resolution(), probes.local())
                                .value_or(0.25 * (in_cell[i] + in_cell[j] + in_cell[k] + in_cell[l]));
    });
    // The two quadrangles of an edge are around crossings on one face of both cells; between these it passes.
    on_face.resize(quads);
    const std::vector<CellEdge> edges = cell_edges(quadrangles);
    for (std::size_t e = 0; e < edges.size(); ++e) {
        const CellEdge& one = edges[e];
        Vec3 middle = points[cells + one.quadrangle];
        on_face[one.quadrangle][one.k] = static_cast<int>(points.size());
        if (e + 1 < edges.size() && one.low == edges[e + 1].low && one.high == edges[e + 1].high) {
            const CellEdge& other = edges[++e];
            middle = 0.5 * (middle + points[cells + other.quadrangle]);
            on_face[other.quadrangle][other.k] = on_face[one.quadrangle][one.k];
        }
        points.push_back(middle);
    }
    for (Vec3& p : points) p = to_float_precision(p);
}

/// The triangles of a quadrangle on the diagonal that is nearer to the crossing it is around.
struct Halves {
    std::array<Triangle, 2> triangles{};
    double distance2 = std::numeric_limits<double>::infinity();  // from the crossing

    Halves() = default;
    Halves(const std::array<int, 4>& corners, const Vec3& crossing, const std::vector<Vec3>& points) {
        for (const int first : {0, 1}) {
            const auto corner = [&](int k) { return corners[(first + k) % 4]; };
            const std::array<Triangle, 2> halves = {
                {{corner(0), corner(1), corner(2)}, {corner(0), corner(2), corner(3)}}};
            double least = std::numeric_limits<double>::infinity();
            for (const auto& [i, j, k] : halves)
                least = std::min(least, squared_distance(crossing, points[i], points[j], points[k]));
            if (least < distance2) {
                distance2 = least;
                triangles = halves;
            }
        }
    }
};

/// The mesh without points that no triangle has.
TriangleMesh compacted(const std::vector<Vec3>& points, std::vector<Triangle> triangles) {
    TriangleMesh mesh;
    std::vector<int> number(points.size(), -1);
    for (Triangle& t : triangles)
        for (int& v : t) {
            if (number[v] < 0) {
                number[v] = static_cast<int>(mesh.points.size());
                mesh.points.push_back(points[v]);
            }
            v = number[v];
        }
    mesh.triangles = std::move(triangles);
    return mesh;
}

}  // namespace

TriangleMesh lattice_mesh_of(const PolygonMesh& quadrangles, const Surface& surface) {
    Pieces pieces(quadrangles, surface);
    TriangleMesh mesh;
    mesh.triangles.reserve(8 * quadrangles.quads.size());
    for (std::size_t q = 0; q < quadrangles.quads.size(); ++q)
        for (int k = 0; k < 4; ++k) {
            const int a = quadrangles.quads[q][k], b = quadrangles.quads[q][(k + 1) % 4],
                      f = pieces.on_face[q][k], crossing = static_cast<int>(quadrangles.points.size() + q);
            mesh.triangles.push_back({a, f, crossing});
            mesh.triangles.push_back({f, b, crossing});
        }
    mesh.points = std::move(pieces.points);
    return mesh;
}

TriangleMesh light_lattice_mesh_of(const PolygonMesh& quadrangles, const Surface& surface, double close) {
    const Pieces pieces(quadrangles, surface);
    const std::vector<Vec3>& points = pieces.points;
    const std::size_t cells = quadrangles.points.size(), quads = quadrangles.quads.size();
    std::vector<Halves> halves(quads);
    parallel_for_each(quads, kGrain, [&](std::size_t q) {
        halves[q] = {quadrangles.quads[q], points[cells + q], points};
    });
    std::vector<char> is_whole(quads, 0), has_point_on_face(points.size(), 0);
    std::vector<Triangle> triangles;
    std::vector<std::size_t> quad_of;  // each triangle
    const auto add = [&](const Triangle& t, std::size_t q) {
        triangles.push_back(t);
        quad_of.push_back(q);
    };
    for (bool more = true; more;) {
        triangles.clear();
        quad_of.clear();
        for (std::size_t q = 0; q < quads; ++q) {
            const auto& corners = quadrangles.quads[q];
            const auto& faces = pieces.on_face[q];
            const int crossing = static_cast<int>(cells + q);
            const auto is_there = [&](int f) { return has_point_on_face[f] != 0; };
            if (halves[q].distance2 <= close * close && std::none_of(faces.begin(), faces.end(), is_there)) {
                for (const Triangle& t : halves[q].triangles) add(t, q);
                continue;
            }
            for (int k = 0; k < 4; ++k) {
                const int a = corners[k], b = corners[(k + 1) % 4], f = faces[k];
                if (is_there(f)) {
                    add({a, f, crossing}, q);
                    add({f, b, crossing}, q);
                } else {
                    add({a, b, crossing}, q);
                }
            }
        }
        more = false;
        const auto pairs = self_intersections(points, triangles);
        for (const auto& [t, u] : pairs)
            for (const std::size_t q : {quad_of[t], quad_of[u]}) {
                if (is_whole[q]) continue;
                is_whole[q] = 1;
                more = true;
                for (const int f : pieces.on_face[q]) has_point_on_face[f] = 1;
            }
        if (!more && !pairs.empty()) return {};
    }
    return compacted(points, std::move(triangles));
}

}  // namespace isotrack
