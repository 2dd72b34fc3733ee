#include "delaunay/incremental.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "delaunay/filters.h"
#include "delaunay/spatial_order.h"
#include "room.h"

namespace isotrack {
namespace {

constexpr int kNone = -1;
constexpr char kUnseen = 0, kConflict = 1, kRim = 2, kFree = 3;

bool infinite(const std::array<int, 4>& v) {
    return (v[0] | v[1] | v[2] | v[3]) < 0;
}

int index_in(const std::array<int, 4>& v, int vertex) {
    return (v[1] == vertex) + 2 * (v[2] == vertex) + 3 * (v[3] == vertex);  // no branches to mispredict
}

}  // namespace

int IncrementalDelaunay::locate(const Vec3& p, int start) const {
    int cell = start, from = -1;
    if (infinite(cells_.vertices[cell]))
        cell = cells_.neighbour(cell, index_in(cells_.vertices[cell], Tetrahedra::kInfinite));
    for (;;) {
        const auto& v = cells_.vertices[cell];
        if (infinite(v)) return cell;
        int exit = -1;
        for (int k = 0; k < 4 && exit < 0; ++k) {
            if (k == from) continue;
            const Vec3* q[4] = {&points[v[0]], &points[v[1]], &points[v[2]], &points[v[3]]};
            q[k] = &p;
            if (filtered_orientation(*q[0], *q[1], *q[2], *q[3]) < 0) exit = k;
        }
        if (exit < 0) return cell;
        const int link = cells_.links[cell][exit];
        cell = link >> 2;
        from = link & 3;
    }
}

int IncrementalDelaunay::vertex_at(const Vec3& p, int cell) const {
    for (const int v : cells_.vertices[cell])
        if (v >= 0 && points[v] == p) return v;
    return -1;
}

bool IncrementalDelaunay::in_conflict(int cell, const Vec3& p) const {
    const auto& v = cells_.vertices[cell];
    if (!infinite(v)) return filtered_in_sphere(points[v[0]], points[v[1]], points[v[2]], points[v[3]], p);
    const int k = index_in(v, Tetrahedra::kInfinite);
    const Vec3* q[4] = {&p, &p, &p, &p};
    for (int j = 0; j < 4; ++j)
        if (j != k) q[j] = &points[v[j]];
    const int side = filtered_orientation(*q[0], *q[1], *q[2], *q[3]);
    // In the plane of the facet the circle decides, in which that plane cuts the sphere of the cell behind
    // it.
    return side != 0 ? side > 0 : in_conflict(cells_.neighbour(cell, k), p);
}

void IncrementalDelaunay::insert(int vertex, int cell) {
    fill_hole(vertex, cell);
    for (const int slot : freed_) blank(slot);
}

/// Finds the cells in conflict with the vertex, `freed_`, and the facets around them, `rim_`.
void IncrementalDelaunay::dig(int vertex, int cell) {
    const Vec3& p = points[vertex];
    // What may belong to a list is written to its end in any case, and counted if it does: a branch on it
    // could not be predicted.
    constexpr std::size_t kRoom = 64;  // more than most holes need
    if (freed_.size() < kRoom) freed_.resize(kRoom);
    if (rim_.size() < kRoom) rim_.resize(kRoom);
    std::size_t in_hole = 0, in_rim = 0;
    // Locals, because a write to a char might be one to anything else.
    char* const marks = marks_.data();
    const auto* const links = cells_.links.data();
    int* hole = freed_.data();  // links: into the cells in conflict, each from the one it was found from
    Facet* around = rim_.data();
    const auto cross = [&](int from, int k) {
        const int link = links[from][k], other = link >> 2;
        char mark = marks[other];
        if (mark == kUnseen) {
            const bool conflict = in_conflict(other, p);
            mark = marks[other] = static_cast<char>(kRim - conflict);
            hole[in_hole] = link;
            in_hole += conflict;
        }
        around[in_rim] = {from, k};
        in_rim += mark == kRim;
    };
    static_assert(kRim - 1 == kConflict);
    constexpr int kOthers[4][3] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};
    marks[cell] = kConflict;
    hole[in_hole++] = Tetrahedra::link(cell, 0);  // as if found across facet 0, so that is crossed here
    cross(cell, 0);
    for (std::size_t i = 0; i < in_hole; ++i) {
        if (in_hole + 3 > freed_.size()) {
            freed_.resize(2 * freed_.size());
            hole = freed_.data();
        }
        if (in_rim + 3 > rim_.size()) {
            rim_.resize(2 * rim_.size());
            around = rim_.data();
        }
        const int from = hole[i] >> 2, back = hole[i] & 3;
        for (const int k : kOthers[back]) cross(from, k);
        hole[i] = from;
    }
    freed_.resize(in_hole);
    rim_.resize(in_rim);
}

/// As `insert`, but the slots that are freed are not blank: their cells stay there, and their marks.
void IncrementalDelaunay::fill_hole(int vertex, int cell) {
    dig(vertex, cell);
    // A cell on every facet of the rim. They meet at the facets between the new vertex and the edges of the
    // rim, each of which two facets have, in opposite directions.
    fresh_.resize(rim_.size());
    for (int& slot : fresh_) slot = new_slot();
    const std::size_t count = rim_.size() / 2 + 2;  // of vertices on the rim, by Euler's formula
    constexpr std::size_t kMostInTable = 256;       // a vertex far outside sees half the hull
    if (count <= kMostInTable) {
        if (edges_.size() < count * count) edges_.resize(count * count);
        int* const table = edges_.data();
        connect(vertex, count, [&](int from, int to) -> int& { return table[count * from + to]; });
    } else {
        std::unordered_map<std::size_t, int> many;
        connect(vertex, count, [&](int from, int to) -> int& { return many[count * from + to]; });
    }
    free_.insert(free_.end(), freed_.begin(), freed_.end());
}

/// Makes the cells of `fresh_`, one on every facet of the rim. `edge(a, b)` is a place for the link across
/// the edge from the a-th of the `count` vertices on the rim to the b-th.
template <typename Edge>
void IncrementalDelaunay::connect(int vertex, std::size_t count, const Edge& edge) {
    if (corner_of_.size() < points.size() + 1) corner_of_.resize(points.size() + 1, kNone);
    corners_.resize(count);
    on_rim_.resize(rim_.size());
    int* const corner_of = corner_of_.data() + 1;  // the infinite vertex may be on the rim
    int* const corners = corners_.data();
    char* const marks = marks_.data();
    auto* const vertices = cells_.vertices.data();
    auto* const links = cells_.links.data();
    int found = 0;
    const auto corner = [&](int v) {
        int& number = corner_of[v];
        if (number == kNone) {
            assert(static_cast<std::size_t>(found) < count);
            number = found;
            corners[found++] = v;
        }
        return number;
    };
    for (std::size_t i = 0; i < rim_.size(); ++i) {
        const Facet facet = rim_[i];
        const auto& f = Tetrahedra::kFacet[facet.k];
        const int slot = fresh_[i], outside = links[facet.cell][facet.k];
        std::array<int, 4> v = vertices[facet.cell];
        const std::array<int, 3> c{corner(v[f[0]]), corner(v[f[1]]), corner(v[f[2]])};
        on_rim_[i] = c;
        v[facet.k] = vertex;
        vertices[slot] = v;
        links[slot][facet.k] = outside;
        links[outside >> 2][outside & 3] = Tetrahedra::link(slot, facet.k);
        marks[slot] = marks[outside >> 2] = kUnseen;
        for (int j = 0; j < 3; ++j) edge(c[j], c[(j + 1) % 3]) = Tetrahedra::link(slot, f[(j + 2) % 3]);
    }
    assert(static_cast<std::size_t>(found) == count);
    for (std::size_t i = 0; i < rim_.size(); ++i) {
        const auto& f = Tetrahedra::kFacet[rim_[i].k];
        const auto& c = on_rim_[i];
        auto& own = links[fresh_[i]];
        for (int j = 0; j < 3; ++j) own[f[(j + 2) % 3]] = edge(c[(j + 1) % 3], c[j]);
    }
    for (const int w : corners_) corner_of[w] = kNone;
}

int IncrementalDelaunay::new_slot() {
    if (!free_.empty()) {
        const int slot = free_.back();
        free_.pop_back();
        return slot;
    }
    ensure_room(cells_.vertices);
    ensure_room(cells_.links);
    ensure_room(marks_);
    cells_.vertices.emplace_back();
    cells_.links.emplace_back();
    marks_.push_back(kUnseen);
    assert(cells_.size() <= Tetrahedra::kMostCells);
    return static_cast<int>(cells_.size()) - 1;
}

void IncrementalDelaunay::free_slot(int slot) {
    blank(slot);
    free_.push_back(slot);
}

/// Writes to a slot what one without a cell has.
void IncrementalDelaunay::blank(int slot) {
    cells_.vertices[slot].fill(Tetrahedra::kInfinite);
    for (int k = 0; k < 4; ++k) cells_.links[slot][k] = Tetrahedra::link(slot, k);
    marks_[slot] = kUnseen;
}

/// Finds four vertices that span a volume and makes the five cells they have.
bool IncrementalDelaunay::start(const std::vector<int>& order, std::array<int, 4>& first) {
    std::size_t found = 0;
    for (const int v : order) {
        const Vec3& p = points[v];
        bool further = true;  // off the point, line or plane of those found
        if (found == 1) further = p != points[first[0]];
        if (found == 2) further = !collinear(points[first[0]], points[first[1]], p);
        if (found == 3) further = orientation(points[first[0]], points[first[1]], points[first[2]], p) != 0;
        if (further) first[found++] = v;
        if (found == 4) break;
    }
    if (found < 4) return false;
    if (orientation(points[first[0]], points[first[1]], points[first[2]], points[first[3]]) < 0)
        std::swap(first[2], first[3]);
    // Cell 0 is the finite one; cell 1 + k is across its facet opposite vertex k, with the infinite vertex
    // for that one and, to be oriented as it should, two of the others exchanged.
    for (int c = 0; c < 5; ++c) new_slot();
    cells_.vertices[0] = first;
    for (int k = 0; k < 4; ++k) {
        const int a = (k + 1) % 4, b = (k + 2) % 4;
        auto& v = cells_.vertices[1 + k];
        v = first;
        v[k] = Tetrahedra::kInfinite;
        std::swap(v[a], v[b]);
        cells_.links[0][k] = Tetrahedra::link(1 + k, k);
        cells_.links[1 + k][k] = Tetrahedra::link(0, k);
    }
    for (int k = 0; k < 4; ++k)
        for (int j = 0; j < 4; ++j)
            if (j != k) {
                // Two of the infinite cells share the facet without either's vertex of the first cell.
                const int mine = index_in(cells_.vertices[1 + k], first[j]),
                          its = index_in(cells_.vertices[1 + j], first[k]);
                cells_.links[1 + k][mine] = Tetrahedra::link(1 + j, its);
            }
    return true;
}

void IncrementalDelaunay::build(std::vector<int>& chosen) {
    constexpr std::size_t kCells = 7;  // per vertex of a sampled surface, about
    const std::size_t cells = kCells * chosen.size();
    clear_for(cells_.vertices, cells);
    clear_for(cells_.links, cells);
    clear_for(marks_, cells);
    free_.clear();
    std::vector<int> order = chosen;
    sort_spatially(points, order);
    std::array<int, 4> first;
    if (!start(order, first)) return;
    int near = 0;
    std::vector<int> twice;
    for (const int v : order) {
        if (std::find(first.begin(), first.end(), v) != first.end()) continue;
        const int cell = locate(points[v], near);
        if (vertex_at(points[v], cell) >= 0) {
            twice.push_back(v);
            near = cell;
            continue;
        }
        fill_hole(v, cell);
        near = fresh_.front();
    }
    for (const int slot : free_) blank(slot);  // the others were used again at once
    if (!twice.empty()) {
        std::sort(twice.begin(), twice.end());
        const auto is_twice = [&](int v) { return std::binary_search(twice.begin(), twice.end(), v); };
        chosen.erase(std::remove_if(chosen.begin(), chosen.end(), is_twice), chosen.end());
    }
}

/// Numbers the cells anew, by their first vertices: those that are near each other in memory are so in space
/// as far as the points are.
void IncrementalDelaunay::arrange() {
    const std::size_t slots = cells_.size();
    const auto key = [&](std::size_t c) {  // that of the infinite vertex is the largest
        const auto& v = cells_.vertices[c];
        return std::min(std::min(static_cast<unsigned>(v[0]), static_cast<unsigned>(v[1])),
                        std::min(static_cast<unsigned>(v[2]), static_cast<unsigned>(v[3])));
    };
    for (const int slot : free_) marks_[slot] = kFree;
    std::vector<int> next(points.size() + 1, 0);
    for (std::size_t c = 0; c < slots; ++c)
        if (marks_[c] == kUnseen) ++next[key(c) + 1];
    std::partial_sum(next.begin(), next.end(), next.begin());
    std::vector<int> number(slots);
    const std::size_t cells = slots - free_.size();
    int behind = static_cast<int>(cells);  // free ones are
    for (std::size_t c = 0; c < slots; ++c) number[c] = marks_[c] == kUnseen ? next[key(c)]++ : behind++;
    for (auto& links : cells_.links)
        for (int& link : links) link = Tetrahedra::link(number[link >> 2], link & 3);
    // One number of each after the other, for with all twice a DT would take its most memory here; and back,
    // so that each stays where it is: places that change would leave holes.
    std::vector<int> ordered(slots);
    const auto put_in_order = [&](std::vector<std::array<int, 4>>& values) {
        for (int k = 0; k < 4; ++k) {
            for (std::size_t c = 0; c < slots; ++c) ordered[number[c]] = values[c][k];
            for (std::size_t c = 0; c < cells; ++c) values[c][k] = ordered[c];
        }
        values.resize(cells);
    };
    put_in_order(cells_.vertices);
    put_in_order(cells_.links);
    marks_.assign(cells_.size(), kUnseen);
    free_.clear();
}

}  // namespace isotrack
