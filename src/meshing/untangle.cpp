#include "isotrack/meshing/untangle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

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

/// Splits stars: the cells around a vertex into fans, sets of one label that hang together through facets at
/// the vertex.
class StarSplitter {
public:
    explicit StarSplitter(const Tetrahedra& cells) : cells_(cells), place_(cells.vertices.size(), -1) {}

    /// The star of `vertex`, which `cell` has.
    void look_at(int vertex, int cell) {
        for (const int c : star_) place_[c] = -1;
        star_.clear();
        vertex_ = vertex;
        const auto add = [&](int c) {
            place_[c] = static_cast<int>(star_.size());
            star_.push_back(c);
        };
        add(cell);
        for (std::size_t s = 0; s < star_.size(); ++s)
            for_each_beside(star_[s], [&](int next) {
                if (place_[next] < 0) add(next);
            });
    }
    /// Calls `take(fan)` with those of the star in turn.
    template <typename Take>
    void for_each_fan(const CellLabels& labels, const Take& take) {
        taken_.assign(star_.size(), 0);
        for (std::size_t s = 0; s < star_.size(); ++s) {
            if (taken_[s]) continue;
            taken_[s] = 1;
            fan_.assign(1, star_[s]);
            for (std::size_t f = 0; f < fan_.size(); ++f)
                for_each_beside(fan_[f], [&](int next) {
                    if (taken_[place_[next]] || labels[next] != labels[star_[s]]) return;
                    taken_[place_[next]] = 1;
                    fan_.push_back(next);
                });
            take(fan_);
        }
    }

private:
    template <typename Visit>
    void for_each_beside(int cell, const Visit& visit) const {
        for (int k = 0; k < 4; ++k)
            if (cells_.vertices[cell][k] != vertex_) visit(cells_.neighbour(cell, k));
    }

    const Tetrahedra& cells_;
    int vertex_ = -1;
    std::vector<int> star_, fan_;
    std::vector<int> place_;  // of each cell in the star; -1: it is not there
    std::vector<char> taken_;
};

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

std::size_t count_tangles(const Tetrahedra& cells, const CellLabels& labels, const Places& places,
                          StarSplitter& splitter) {
    std::vector<int> ring;
    std::size_t count = 0;
    for (const Edge& e : places.edges) {
        ring_of(cells, e, ring);
        count += is_complex(labels, ring);
    }
    for (const auto& [v, c] : places.vertices) {
        int fans = 0;
        splitter.look_at(v, c);
        splitter.for_each_fan(labels, [&](const std::vector<int>&) { ++fans; });
        count += fans > 2;
    }
    return count;
}

}  // namespace

bool untangle(CellLabels& labels, const Tetrahedra& cells, const std::vector<Vec3>& points,
              const Surface& surface, const CarvedSurface& carved, std::optional<double> detail) {
    if (carved.complex_edges.empty() && carved.pinched.empty()) return false;
    const auto probe = surface.probe();
    StarSplitter splitter(cells);
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
            const std::size_t before = count_tangles(cells, labels, places, splitter);
            for (const int c : run.cells) labels[c] = !labels[c];
            if (count_tangles(cells, labels, places, splitter) < before) {
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
            std::vector<std::vector<int>> fans;
            splitter.look_at(v, cell);
            splitter.for_each_fan(labels, [&](const std::vector<int>& fan) { fans.push_back(fan); });
            if (fans.size() <= 2) continue;
            std::vector<Run> runs;
            for (auto& fan : fans) runs.push_back(run_of(std::move(fan)));
            relabel(runs);
        }
        if (changed.empty()) break;
        any = true;
        places = places_of(cells, changed);  // what is still tangled elsewhere stays so
    }
    return any;
}

}  // namespace isotrack
