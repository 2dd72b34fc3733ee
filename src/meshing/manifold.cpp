#include "isotrack/meshing/manifold.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <tuple>
#include <utility>

#include "find_in_blocks.h"
#include "meshing/corners.h"

namespace isotrack {
namespace {

/// The boundary facets of the inside cells, as links, ascending.
std::vector<int> boundary_facets(const Tetrahedra& cells, const CellLabels& labels) {
    constexpr std::size_t kBlock = 8192, kCells = 256;
    return find_in_blocks<int>(
        cells.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
            std::array<int, 4 * kCells> links;
            for (; begin < end; begin += kCells) {
                std::size_t count = 0;  // without a branch, which would be mispredicted
                for (int c = static_cast<int>(begin); c < static_cast<int>(std::min(end, begin + kCells));
                     ++c)
                    for (int k = 0; k < 4; ++k) {
                        links[count] = Tetrahedra::link(c, k);
                        count += (labels[c] != 0) & (labels[cells.neighbour(c, k)] == 0);
                    }
                found.insert(found.end(), links.begin(), links.begin() + static_cast<std::ptrdiff_t>(count));
            }
        });
}

/// These facets of a surface by number, which must stay while they are asked about, and which one follows
/// which around an edge.
class Boundary {
public:
    Boundary(const Tetrahedra& cells, const CellLabels& labels, const CarvedSurface& surface)
        : cells_(cells), labels_(labels), surface_(surface) {}
    Triangle particles(std::size_t facet) const {
        const auto& v = cells_.vertices[surface_.inside_cell(facet)];
        const auto& f = Tetrahedra::kFacet[surface_.inside_facet(facet)];
        return {v[f[0]], v[f[1]], v[f[2]]};
    }

    struct Side {
        int facet, corner;  // the edge opposite this corner
    };
    /// The facet on the other side of the edge opposite `corner`, by rotation through inside cells.
    Side mate(int facet, int corner) const {
        int cell = surface_.inside_cell(facet);
        int other = surface_.inside_facet(facet);       // the remaining vertex off the edge
        int cross = Tetrahedra::kFacet[other][corner];  // the facet to cross next is opposite this vertex
        while (labels_[cells_.neighbour(cell, cross)]) {
            const int next = cells_.neighbour(cell, cross);
            const int pivot = cells_.vertices[cell][other];
            const int entry = cells_.mirror_index(cell, cross);
            cell = next;
            cross = cells_.index_of(next, pivot);
            other = entry;
        }
        const auto& facets = surface_.facet;
        const auto at = std::lower_bound(facets.begin(), facets.end(), Tetrahedra::link(cell, cross));
        const auto& f = Tetrahedra::kFacet[cross];
        return {static_cast<int>(at - facets.begin()), f[0] == other ? 0 : f[1] == other ? 1 : 2};
    }

private:
    const Tetrahedra& cells_;
    const CellLabels& labels_;
    const CarvedSurface& surface_;
};

struct HalfEdge {
    int from, to, triangle, corner;  // the edge opposite `corner`
    bool operator<(const HalfEdge& o) const {
        return std::tie(from, to, triangle) < std::tie(o.from, o.to, o.triangle);
    }
};

/// Whether the triangles at a vertex are a single fan: from each to the next around it they come back to the
/// first after all, and no edge is met twice.
bool is_fan(int v, const Corners& corners, const std::vector<Triangle>& triangles) {
    constexpr int kNext[] = {1, 2, 0};
    constexpr int kUsual = 16;  // triangles, at most
    std::array<int, kUsual> usual_from, usual_to;
    std::vector<int> many;
    const int begin = corners.first[v], count = corners.first[v + 1] - begin;
    if (count > kUsual) many.resize(2 * count);
    // Of the edge opposite v in each.
    int* const from = count > kUsual ? many.data() : usual_from.data();
    int* const to = count > kUsual ? many.data() + count : usual_to.data();
    for (int n = 0; n < count; ++n) {
        const int corner = corners.corner[begin + n], k = corner % 3;
        const Triangle& t = triangles[corner / 3];
        from[n] = t[kNext[k]];
        to[n] = t[kNext[kNext[k]]];
    }
    int at = from[0];
    for (int left = count; left > 0; --left) {
        int next = 0, found = 0;
        for (int n = 0; n < count; ++n) {  // without a branch, which would be mispredicted
            next += from[n] == at ? n : 0;
            found += from[n] == at;
        }
        if (found != 1) return false;
        at = to[next];
        if (at == from[0]) return left == 1;
    }
    return false;
}

}  // namespace

CarvedSurface carve(const Tetrahedra& cells, const CellLabels& labels, const std::vector<Vec3>& points) {
    CarvedSurface result;
    result.facet = boundary_facets(cells, labels);
    const Boundary boundary(cells, labels, result);
    const std::size_t count = result.facet.size();
    const auto for_each_facet = [&](const auto& body) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1024), [&](const auto& range) {
            for (std::size_t f = range.begin(); f < range.end(); ++f) body(f);
        });
    };
    result.triangles.resize(count);
    for_each_facet([&](std::size_t f) { result.triangles[f] = boundary.particles(f); });
    const Corners corners(points.size(), result.triangles);
    std::vector<char> tangled(points.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 512), [&](const auto& range) {
        for (std::size_t p = range.begin(); p < range.end(); ++p)
            tangled[p] = corners.first[p] < corners.first[p + 1] &&
                         !is_fan(static_cast<int>(p), corners, result.triangles);
    });

    // Around a particle whose triangles are no single fan, going from mate to mate around a corner comes back
    // to it: each such cycle is a vertex. The first, in the order of the facets, is its own; the others are
    // copies.
    struct Copy {
        int particle, corner;  // 3 * facet + corner: the first of its cycle
        std::vector<int> cycle;
    };
    std::vector<Copy> copies;
    result.particle.reserve(points.size());
    for (std::size_t p = 0; p < points.size(); ++p) {
        if (corners.first[p] < corners.first[p + 1]) result.particle.push_back(static_cast<int>(p));
        if (!tangled[p]) continue;
        std::vector<int> left(corners.corner.begin() + corners.first[p],
                              corners.corner.begin() + corners.first[p + 1]);
        for (bool own = true; !left.empty(); own = false) {
            std::vector<int> cycle;
            int at = left.front();
            do {
                cycle.push_back(at);
                const Boundary::Side next = boundary.mate(at / 3, (at % 3 + 1) % 3);
                at = 3 * next.facet +
                     (next.corner + 1) % 3;  // mates run along their edge in opposite directions
            } while (at != left.front());
            left.erase(std::remove_if(
                           left.begin(), left.end(),
                           [&](int c) { return std::find(cycle.begin(), cycle.end(), c) != cycle.end(); }),
                       left.end());
            if (own) continue;
            const int first = *std::min_element(cycle.begin(), cycle.end());
            copies.push_back({static_cast<int>(p), first, std::move(cycle)});
        }
    }
    std::sort(copies.begin(), copies.end(), [](const Copy& a, const Copy& b) { return a.corner < b.corner; });
    std::vector<int> vertex_of(points.size(), -1);
    for (std::size_t v = 0; v < result.particle.size(); ++v)
        vertex_of[result.particle[v]] = static_cast<int>(v);
    for_each_facet([&](std::size_t f) {
        for (int& v : result.triangles[f]) v = vertex_of[v];
    });
    for (const Copy& copy : copies) {
        for (const int c : copy.cycle)
            result.triangles[c / 3][c % 3] = static_cast<int>(result.particle.size());
        result.particle.push_back(copy.particle);
        result.pinched.push_back({copy.particle, result.inside_cell(copy.corner / 3)});
    }
    std::stable_sort(result.pinched.begin(), result.pinched.end(),
                     [](const auto& a, const auto& b) { return a.particle < b.particle; });
    result.pinched.erase(std::unique(result.pinched.begin(), result.pinched.end(),
                                     [](const auto& a, const auto& b) { return a.particle == b.particle; }),
                         result.pinched.end());

    // An edge that is met twice in one direction is so at both of its ends.
    std::vector<HalfEdge> raw_edges;
    for (std::size_t p = 0; p < points.size(); ++p) {
        if (!tangled[p]) continue;
        for (int c = corners.first[p]; c < corners.first[p + 1]; ++c) {
            const int t = corners.corner[c] / 3, k = corners.corner[c] % 3,
                      to = boundary.particles(t)[(k + 1) % 3];
            if (tangled[to]) raw_edges.push_back({static_cast<int>(p), to, t, (k + 2) % 3});
        }
    }
    std::sort(raw_edges.begin(), raw_edges.end());
    for (std::size_t e = 1; e < raw_edges.size(); ++e) {
        const HalfEdge &a = raw_edges[e - 1], &b = raw_edges[e];
        const bool repeated = a.from == b.from && a.to == b.to;
        const bool counted = e >= 2 && raw_edges[e - 2].from == b.from && raw_edges[e - 2].to == b.to;
        if (!repeated || counted || a.from > a.to) continue;
        result.complex_edges.push_back({a.from, a.to, result.inside_cell(a.triangle)});
    }

    // Different edges between the same two output vertices: they get midpoints. Mates keep the pairs apart.
    if (!result.complex_edges.empty()) {
        // Where that happens every edge over the same two particles is split, so that what touches keeps
        // touching in whole edges.
        std::vector<HalfEdge> edges;
        for (const HalfEdge& e : raw_edges) {
            const Triangle& t = result.triangles[e.triangle];
            edges.push_back({t[(e.corner + 1) % 3], t[(e.corner + 2) % 3], e.triangle, e.corner});
        }
        std::sort(edges.begin(), edges.end());
        std::vector<std::pair<int, int>> ambiguous;
        const auto particles_of = [&](const HalfEdge& e) {
            return std::minmax(result.particle[e.from], result.particle[e.to]);
        };
        for (std::size_t e = 1; e < edges.size(); ++e)
            if (edges[e - 1].from == edges[e].from && edges[e - 1].to == edges[e].to)
                ambiguous.emplace_back(particles_of(edges[e]));
        std::sort(ambiguous.begin(), ambiguous.end());
        std::vector<std::array<int, 2>> to_split;  // triangle, corner; each pair of mates once
        for (const HalfEdge& e : edges)
            if (e.triangle < boundary.mate(e.triangle, e.corner).facet &&
                std::binary_search(ambiguous.begin(), ambiguous.end(), std::pair<int, int>(particles_of(e))))
                to_split.push_back({e.triangle, e.corner});
        std::vector<std::array<int, 3>> midpoint(count, {-1, -1, -1});
        for (const auto& [t, k] : to_split) {
            const int a = result.triangles[t][(k + 1) % 3], b = result.triangles[t][(k + 2) % 3];
            const int m = static_cast<int>(result.particle.size());
            result.midpoints.push_back(0.5 * (points[result.particle[a]] + points[result.particle[b]]));
            result.particle.push_back(-1);
            midpoint[t][k] = m;
            const Boundary::Side mate = boundary.mate(t, k);
            midpoint[mate.facet][mate.corner] = m;
        }
        for (std::size_t f = 0; f < count; ++f) {
            // A triangle with midpoints on its edges, as a polygon, fanned from a midpoint: no two halves
            // share an unsplit edge twice.
            std::vector<int> polygon;
            int start = -1;
            for (int k = 0; k < 3; ++k) {
                polygon.push_back(result.triangles[f][k]);
                const int m = midpoint[f][(k + 2) % 3];  // edge from corner k to k+1
                if (m < 0) continue;
                start = static_cast<int>(polygon.size());
                polygon.push_back(m);
            }
            if (start < 0) continue;
            std::rotate(polygon.begin(), polygon.begin() + start, polygon.end());
            result.triangles[f] = {polygon[0], polygon[1], polygon[2]};
            for (std::size_t k = 3; k < polygon.size(); ++k) {
                result.triangles.push_back({polygon[0], polygon[k - 1], polygon[k]});
                result.facet.push_back(result.facet[f]);
            }
        }
    }
    return result;
}

}  // namespace isotrack
