#include "isotrack/meshing/untangle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "surface/far_value.h"

namespace isotrack {
namespace {

constexpr double kUncertain = 0.5;  // details
constexpr int kPasses = 4;

/// An edge of the DT by one cell that has it: the edge between vertices a and b.
struct Edge {
    int a, b, cell;
    bool same_place(const Edge& o) const { return a == o.a && b == o.b; }
    bool operator<(const Edge& o) const { return std::tie(a, b, cell) < std::tie(o.a, o.b, o.cell); }
};

Edge edge_of(const Tetrahedra& cells, int cell, int i, int j) {
    const auto [a, b] = std::minmax(cells.vertices[cell][i], cells.vertices[cell][j]);
    return {a, b, cell};
}

/// All cells around an edge, in order.
void ring_of(const Tetrahedra& cells, const Edge& edge, std::vector<int>& ring) {
    ring.clear();
    int cell = edge.cell, other[2], count = 0;  // the two indices off the edge
    for (int k = 0; k < 4; ++k)
        if (cells.vertices[cell][k] != edge.a && cells.vertices[cell][k] != edge.b) other[count++] = k;
    int cross = other[0], pivot = cells.vertices[cell][other[1]];
    do {
        ring.push_back(cell);
        const int entry = cells.vertices[cells.neighbour(cell, cross)][cells.mirror_index(cell, cross)];
        cell = cells.neighbour(cell, cross);
        cross = cells.index_of(cell, pivot);
        pivot = entry;
    } while (cell != edge.cell);
}

bool is_complex(const CellLabels& labels, const std::vector<int>& ring) {
    int changes = 0;
    for (std::size_t i = 0; i < ring.size(); ++i)
        changes += labels[ring[i]] != labels[ring[(i + 1) % ring.size()]];
    return changes > 2;
}

/// The cells around a vertex, split into sets of one label that hang together through facets at the vertex.
std::vector<std::vector<int>> fans_of(const Tetrahedra& cells, const CellLabels& labels, int vertex,
                                      int cell) {
    std::vector<std::vector<int>> fans;
    std::vector<int> star{cell};
    for (std::size_t s = 0; s < star.size(); ++s)
        for (int k = 0; k < 4; ++k) {
            if (cells.vertices[star[s]][k] == vertex) continue;
            const int next = cells.neighbour(star[s], k);
            if (std::find(star.begin(), star.end(), next) == star.end()) star.push_back(next);
        }
    std::vector<char> taken(star.size(), 0);
    for (std::size_t s = 0; s < star.size(); ++s) {
        if (taken[s]) continue;
        taken[s] = 1;
        std::vector<int> fan{star[s]};
        for (std::size_t f = 0; f < fan.size(); ++f)
            for (int k = 0; k < 4; ++k) {
                if (cells.vertices[fan[f]][k] == vertex) continue;
                const int next = cells.neighbour(fan[f], k);
                const auto at =
                    static_cast<std::size_t>(std::find(star.begin(), star.end(), next) - star.begin());
                if (taken[at] || labels[next] != labels[fan[0]]) continue;
                taken[at] = 1;
                fan.push_back(next);
            }
        fans.push_back(std::move(fan));
    }
    return fans;
}

/// Where tangles may be: edges and vertices, each with a cell that has it.
struct Places {
    std::vector<Edge> edges;
    std::vector<CarvedSurface::Pinch> vertices;
};

/// The edges and vertices of some cells, each once.
Places places_of(const Tetrahedra& cells, const std::vector<int>& of) {
    Places result;
    for (const int c : of)
        for (int i = 0; i < 4; ++i) {
            if (cells.vertices[c][i] >= 0) result.vertices.push_back({cells.vertices[c][i], c});
            for (int j = i + 1; j < 4; ++j) result.edges.push_back(edge_of(cells, c, i, j));
        }
    auto& [edges, vertices] = result;
    std::sort(edges.begin(), edges.end());
    edges.erase(
        std::unique(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) { return a.same_place(b); }),
        edges.end());
    std::sort(vertices.begin(), vertices.end(), [](const auto& a, const auto& b) {
        return std::tie(a.particle, a.cell) < std::tie(b.particle, b.cell);
    });
    vertices.erase(std::unique(vertices.begin(), vertices.end(),
                               [](const auto& a, const auto& b) { return a.particle == b.particle; }),
                   vertices.end());
    return result;
}

std::size_t count_tangles(const Tetrahedra& cells, const CellLabels& labels, const Places& places) {
    std::vector<int> ring;
    std::size_t count = 0;
    for (const Edge& e : places.edges) {
        ring_of(cells, e, ring);
        count += is_complex(labels, ring);
    }
    for (const auto& [v, c] : places.vertices) count += fans_of(cells, labels, v, c).size() > 2;
    return count;
}

}  // namespace

bool untangle(CellLabels& labels, const Tetrahedra& cells, const std::vector<Vec3>& points,
              const Surface& surface, const CarvedSurface& carved, std::optional<double> detail) {
    const auto probe = surface.probe();
    const double limit = kUncertain * detail.value_or(surface.resolution());
    struct Run {
        double certainty;
        std::vector<int> cells;
    };
    const auto run_of = [&](std::vector<int> of) {
        Run run{0.0, std::move(of)};
        for (const int c : run.cells) {
            const auto& v = cells.vertices[c];
            if (cells.is_infinite(c)) return Run{std::numeric_limits<double>::infinity(), {}};
            const Vec3 centroid = 0.25 * (points[v[0]] + points[v[1]] + points[v[2]] + points[v[3]]);
            run.certainty =
                std::max(run.certainty, std::abs(far_value(*probe, centroid, surface.resolution())));
        }
        return run;
    };
    std::vector<int> changed;
    /// Changes the label of the least certain run that lessens the tangles.
    const auto relabel = [&](std::vector<Run>& runs) {
        std::stable_sort(runs.begin(), runs.end(),
                         [](const Run& a, const Run& b) { return a.certainty < b.certainty; });
        for (const Run& run : runs) {
            if (run.certainty > limit) break;
            const Places places = places_of(cells, run.cells);
            const std::size_t before = count_tangles(cells, labels, places);
            for (const int c : run.cells) labels[c] = !labels[c];
            if (count_tangles(cells, labels, places) < before) {
                changed.insert(changed.end(), run.cells.begin(), run.cells.end());
                return;
            }
            for (const int c : run.cells) labels[c] = !labels[c];
        }
    };

    Places places;
    for (const auto& e : carved.complex_edges) places.edges.push_back({e.from, e.to, e.cell});
    places.vertices = carved.pinched;
    bool any = false;
    std::vector<int> ring;
    for (int pass = 0; pass < kPasses; ++pass) {
        changed.clear();
        for (const Edge& e : places.edges) {
            ring_of(cells, e, ring);
            if (!is_complex(labels, ring)) continue;
            std::size_t start = 0;  // of a run
            while (labels[ring[start]] == labels[ring[(start + ring.size() - 1) % ring.size()]]) ++start;
            std::rotate(ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(start), ring.end());
            std::vector<Run> runs;
            for (std::size_t i = 0, end; i < ring.size(); i = end) {
                for (end = i + 1; end < ring.size() && labels[ring[end]] == labels[ring[i]];) ++end;
                runs.push_back(run_of({ring.begin() + static_cast<std::ptrdiff_t>(i),
                                       ring.begin() + static_cast<std::ptrdiff_t>(end)}));
            }
            relabel(runs);
        }
        for (const auto& [v, cell] : places.vertices) {
            const auto fans = fans_of(cells, labels, v, cell);
            if (fans.size() <= 2) continue;
            std::vector<Run> runs;
            for (const auto& fan : fans) runs.push_back(run_of(fan));
            relabel(runs);
        }
        if (changed.empty()) break;
        any = true;
        places = places_of(cells, changed);  // what is still tangled elsewhere stays so
    }
    return any;
}

}  // namespace isotrack
