#include "isotrack/meshing/manifold.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <tuple>

namespace isotrack {
namespace {

/// The boundary facets of the inside cells, and which one follows which around an edge.
class Boundary {
public:
    Boundary(const Tetrahedra& cells, const CellLabels& labels)
        : cells_(cells), labels_(labels), number_(4 * cells.size(), -1) {
        for (std::size_t c = 0; c < cells.size(); ++c) {
            if (!labels[c]) continue;
            for (int k = 0; k < 4; ++k)
                if (!labels[cells.neighbours[c][k]]) {
                    number_[4 * c + k] = static_cast<int>(facets_.size());
                    facets_.push_back({static_cast<int>(c), k});
                }
        }
    }
    struct Facet {
        int cell, k;
    };
    const std::vector<Facet>& facets() const { return facets_; }
    int particle(int facet, int corner) const {
        const Facet& f = facets_[facet];
        return cells_.vertices[f.cell][Tetrahedra::kFacet[f.k][corner]];
    }

    struct Side {
        int facet, corner;  // the edge opposite this corner
    };
    /// The facet on the other side of the edge opposite `corner`, by rotation through inside cells.
    Side mate(int facet, int corner) const {
        int cell = facets_[facet].cell;
        int cross =
            Tetrahedra::kFacet[facets_[facet].k][corner];  // the facet to cross next is opposite this vertex
        int other = facets_[facet].k;                      // the remaining vertex off the edge
        while (number_[4 * cell + cross] < 0) {
            const int next = cells_.neighbours[cell][cross];
            const int pivot = cells_.vertices[cell][other];
            const int entry = cells_.mirror_index(cell, cross);
            cell = next;
            cross = cells_.index_of(next, pivot);
            other = entry;
        }
        const auto& f = Tetrahedra::kFacet[cross];
        return {number_[4 * cell + cross], f[0] == other ? 0 : f[1] == other ? 1 : 2};
    }

private:
    const Tetrahedra& cells_;
    const CellLabels& labels_;
    std::vector<int> number_;
    std::vector<Facet> facets_;
};

struct HalfEdge {
    int from, to, triangle, corner;  // the edge opposite `corner`
    bool operator<(const HalfEdge& o) const {
        return std::tie(from, to, triangle) < std::tie(o.from, o.to, o.triangle);
    }
};

/// Sorted: by a counting sort over the vertices they start from, which leaves a handful to sort at each.
std::vector<HalfEdge> sorted_half_edges(const std::vector<Triangle>& triangles, std::size_t vertices) {
    std::vector<int> first(vertices + 1, 0);
    for (const Triangle& t : triangles)
        for (const int v : t) ++first[v + 1];
    for (std::size_t v = 0; v < vertices; ++v) first[v + 1] += first[v];
    std::vector<int> end(first.begin(), first.end() - 1);
    std::vector<HalfEdge> edges(3 * triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t)
        for (int k = 0; k < 3; ++k) {
            const int from = triangles[t][(k + 1) % 3], to = triangles[t][(k + 2) % 3];
            edges[end[from]++] = {from, to, static_cast<int>(t), k};
        }
    for (std::size_t v = 0; v < vertices; ++v)
        std::sort(edges.begin() + first[v], edges.begin() + first[v + 1]);
    return edges;
}

}  // namespace

CarvedSurface carve(const Tetrahedra& cells, const CellLabels& labels, const std::vector<Vec3>& points) {
    const Boundary boundary(cells, labels);
    const auto& facets = boundary.facets();
    const std::size_t count = facets.size();

    std::vector<std::array<Boundary::Side, 3>> mates(count);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 512), [&](const auto& range) {
        for (std::size_t f = range.begin(); f < range.end(); ++f)
            for (int k = 0; k < 3; ++k) mates[f][k] = boundary.mate(static_cast<int>(f), k);
    });
    // Going from mate to mate around a corner comes back to it; the least corner stands for its cycle.
    std::vector<int> set(3 * count, -1);
    for (std::size_t c = 0; c < set.size(); ++c)
        for (int at = static_cast<int>(c); set[at] < 0;) {
            set[at] = static_cast<int>(c);
            const Boundary::Side& next = mates[at / 3][(at % 3 + 1) % 3];
            // Mates run along their edge in opposite directions.
            at = 3 * next.facet + (next.corner + 1) % 3;
        }

    // The first corner set at a particle, in the order of the facets, is its own vertex; the others are
    // copies.
    CarvedSurface result;
    std::vector<int> first_set(points.size(), -1);
    std::vector<int> copies;
    for (std::size_t c = 0; c < 3 * count; ++c) {
        if (set[c] != static_cast<int>(c)) continue;
        const int p = boundary.particle(static_cast<int>(c / 3), static_cast<int>(c % 3));
        if (first_set[p] < 0)
            first_set[p] = static_cast<int>(c);
        else
            copies.push_back(static_cast<int>(c));
    }
    std::vector<int> vertex_of_set(3 * count, -1);
    for (std::size_t p = 0; p < points.size(); ++p)
        if (first_set[p] >= 0) {
            vertex_of_set[first_set[p]] = static_cast<int>(result.particle.size());
            result.particle.push_back(static_cast<int>(p));
        }
    for (const int c : copies) {
        const int p = boundary.particle(c / 3, c % 3);
        vertex_of_set[c] = static_cast<int>(result.particle.size());
        result.particle.push_back(p);
        result.pinched.push_back({p, facets[c / 3].cell});
    }
    std::sort(result.pinched.begin(), result.pinched.end(),
              [](const auto& a, const auto& b) { return a.particle < b.particle; });
    result.pinched.erase(std::unique(result.pinched.begin(), result.pinched.end(),
                                     [](const auto& a, const auto& b) { return a.particle == b.particle; }),
                         result.pinched.end());

    result.triangles.resize(count);
    std::vector<Triangle> in_particles(count);
    for (std::size_t f = 0; f < count; ++f) {
        for (int k = 0; k < 3; ++k) {
            result.triangles[f][k] = vertex_of_set[set[3 * f + k]];
            in_particles[f][k] = boundary.particle(static_cast<int>(f), k);
        }
        result.inside_cell.push_back(facets[f].cell);
        result.inside_facet.push_back(facets[f].k);
    }

    const auto raw_edges = sorted_half_edges(in_particles, points.size());
    for (std::size_t e = 1; e < raw_edges.size(); ++e) {
        const HalfEdge &a = raw_edges[e - 1], &b = raw_edges[e];
        const bool repeated = a.from == b.from && a.to == b.to;
        const bool counted = e >= 2 && raw_edges[e - 2].from == b.from && raw_edges[e - 2].to == b.to;
        if (!repeated || counted || a.from > a.to) continue;
        result.complex_edges.push_back({a.from, a.to, facets[a.triangle].cell});
    }

    std::vector<char> in_dt(points.size(), 0);
    for (const auto& cell : cells.vertices)
        for (const int v : cell)
            if (v >= 0) in_dt[v] = 1;
    for (std::size_t p = 0; p < points.size(); ++p)
        if (in_dt[p] && first_set[p] < 0) result.unused.push_back(static_cast<int>(p));

    // Different edges between the same two output vertices: they get midpoints. `mates` keeps the pairs
    // apart.
    if (!result.complex_edges.empty()) {
        // Where that happens every edge over the same two particles is split, so that what touches keeps
        // touching in whole edges.
        const auto edges = sorted_half_edges(result.triangles, result.particle.size());
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
            if (e.triangle < mates[e.triangle][e.corner].facet &&
                std::binary_search(ambiguous.begin(), ambiguous.end(), std::pair<int, int>(particles_of(e))))
                to_split.push_back({e.triangle, e.corner});
        std::vector<std::array<int, 3>> midpoint(count, {-1, -1, -1});
        for (const auto& [t, k] : to_split) {
            const int a = result.triangles[t][(k + 1) % 3], b = result.triangles[t][(k + 2) % 3];
            const int m = static_cast<int>(result.particle.size());
            result.midpoints.push_back(0.5 * (points[result.particle[a]] + points[result.particle[b]]));
            result.particle.push_back(-1);
            midpoint[t][k] = m;
            midpoint[mates[t][k].facet][mates[t][k].corner] = m;
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
                result.inside_cell.push_back(facets[f].cell);
                result.inside_facet.push_back(facets[f].k);
            }
        }
    }
    return result;
}

}  // namespace isotrack
