#include "delaunay/incremental.h"

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <numeric>
#include <utility>

#include "delaunay/simultaneous_insertion.h"
#include "delaunay/spatial_order.h"
#include "parallel_for_each.h"
#include "room.h"
#include "thread_count.h"

namespace isotrack {
namespace {

using Step = Insertion<LoneMarks>;

constexpr std::size_t kGrain = 4096;  // cells, or vertices

/// For cells of so many vertices.
std::size_t room_for(std::size_t vertices, int threads) {
    constexpr std::size_t kCells = 7;  // per vertex of a sampled surface, about
    return kCells * vertices + (threads > 1 ? SimultaneousInsertion::slack(threads) : 0);
}

/// The even permutations of four: entry j is that which was entry `from[n][j]`, and what was entry k is entry
/// `to[n][k]`.
struct EvenPermutations {
    int from[12][4], to[12][4];
};
constexpr EvenPermutations even_permutations() {
    EvenPermutations result{};
    for (int n = 0; n < 12; ++n)
        for (int j = 0; j < 4; ++j) {
            const int from = j == 0 ? n / 3 : Tetrahedra::kFacet[n / 3][(n + j - 1) % 3];
            result.from[n][j] = from;
            result.to[n][from] = j;
        }
    return result;
}
constexpr EvenPermutations kEven = even_permutations();

/// The one with which the smallest vertex comes first and the smallest of the others next, where the infinite
/// vertex is the largest.
int even_permutation_of(const std::array<int, 4>& v) {
    // Numbers with their entries in the lowest bits: the least of some is found without a branch.
    const auto entry = [&](int k) {
        return std::uint64_t{static_cast<unsigned>(v[k])} << 2 | static_cast<unsigned>(k);
    };
    const int first = std::min(std::min(entry(0), entry(1)), std::min(entry(2), entry(3))) & 3;
    const auto& others = Tetrahedra::kFacet[first];
    const auto other = [&](int r) {
        return std::uint64_t{static_cast<unsigned>(v[others[r]])} << 2 | static_cast<unsigned>(r);
    };
    const int next = std::min(std::min(other(0), other(1)), other(2)) & 3;
    return 3 * first + next;
}

}  // namespace

int IncrementalDelaunay::locate(const Vec3& p, int start) {
    return insertion().locate(p, start);
}

int IncrementalDelaunay::vertex_at(const Vec3& p, int cell) {
    return insertion().vertex_at(p, cell);
}

bool IncrementalDelaunay::in_conflict(int cell, const Vec3& p) {
    return insertion().in_conflict(cell, p);
}

void IncrementalDelaunay::insert(int vertex, int cell) {
    fill_hole(vertex, cell);
    for (const int slot : room_.freed) blank(slot);
}

/// As `insert`, but the slots that are freed are not blank: their cells stay there, and their marks.
void IncrementalDelaunay::fill_hole(int vertex, int cell) {
    insertion().dig(vertex, cell);
    room_.fresh.resize(room_.rim.size());
    for (int& slot : room_.fresh) slot = new_slot();
    insertion().fill(vertex);
    free_.insert(free_.end(), room_.freed.begin(), room_.freed.end());
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
    marks_.push_back(cell_mark::kUnseen);
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
    marks_[slot] = cell_mark::kUnseen;
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
                const int mine = Step::index_in(cells_.vertices[1 + k], first[j]),
                          its = Step::index_in(cells_.vertices[1 + j], first[k]);
                cells_.links[1 + k][mine] = Tetrahedra::link(1 + j, its);
            }
    return true;
}

/// Takes away all cells and makes the first five. False where the vertices span no volume. `room`: cells.
bool IncrementalDelaunay::start_anew(const std::vector<int>& order, std::size_t room,
                                     std::array<int, 4>& first) {
    clear_for(cells_.vertices, room);
    clear_for(cells_.links, room);
    clear_for(marks_, room);
    free_.clear();
    return start(order, first);
}

/// Adds vertices one after another. Returns those that are on the place of another.
std::vector<int> IncrementalDelaunay::add(const int* begin, const int* end, int near) {
    std::vector<int> twice;
    for (; begin != end; ++begin) {
        const Vec3& p = points[*begin];
        const int cell = locate(p, near);
        if (vertex_at(p, cell) >= 0) {
            twice.push_back(*begin);
            near = cell;
            continue;
        }
        fill_hole(*begin, cell);
        near = room_.fresh.front();
    }
    return twice;
}

/// Adds vertices by several threads. False, and not all are there, where some are on the place of others.
bool IncrementalDelaunay::add_simultaneously(const std::vector<int>& order, int threads) {
    constexpr std::ptrdiff_t kAlone = 1000;  // vertices, at most: in a small DT all are in each other's way
    const int *const begin = order.data(), *const end = begin + order.size();
    std::vector<const int*> rounds{end};
    while (rounds.back() - begin > kAlone) {
        const auto count = static_cast<double>(rounds.back() - begin);
        rounds.push_back(begin + static_cast<std::ptrdiff_t>(kRoundShare * count));
    }
    if (!add(begin, rounds.back(), 0).empty()) return false;
    SimultaneousInsertion insertion(points, cells_, marks_, free_, room_for(order.size(), threads), threads);
    for (std::size_t r = rounds.size() - 1; r > 0; --r)
        if (!insertion.add(rounds[r], rounds[r - 1])) return false;
    const std::vector<int> left = insertion.finish();
    const auto is_cell = [](char mark) { return mark == cell_mark::kUnseen; };
    const auto near = std::find_if(marks_.begin(), marks_.end(), is_cell) - marks_.begin();
    return add(left.data(), left.data() + left.size(), static_cast<int>(near)).empty();
}

void IncrementalDelaunay::build(std::vector<int>& chosen, int threads) {
    constexpr std::size_t kPerThread = 1000;  // vertices, at least
    if (threads <= 0) threads = thread_count();
    threads = static_cast<int>(std::min<std::size_t>(threads, chosen.size() / kPerThread));
    std::vector<int> order = chosen;
    sort_spatially(points, order);
    std::array<int, 4> first;
    const std::size_t room = room_for(order.size(), threads);
    if (!start_anew(order, room, first)) return;
    const auto is_first = [&](int v) { return std::find(first.begin(), first.end(), v) != first.end(); };
    order.erase(std::remove_if(order.begin(), order.end(), is_first), order.end());
    if (threads < 2 || !add_simultaneously(order, threads)) {
        if (threads > 1) start_anew({first.begin(), first.end()}, room, first);
        std::vector<int> twice = add(order.data(), order.data() + order.size(), 0);
        std::sort(twice.begin(), twice.end());
        const auto is_twice = [&](int v) { return std::binary_search(twice.begin(), twice.end(), v); };
        chosen.erase(std::remove_if(chosen.begin(), chosen.end(), is_twice), chosen.end());
    }
    for (const int slot : free_) blank(slot);  // the others were used again at once
}

/// Numbers the cells anew, by their vertices, and puts these in order: those that are near each other in
/// memory are so in space as far as the points are, and who came first does not show.
void IncrementalDelaunay::arrange() {
    const std::size_t slots = cells_.size();
    for (const int slot : free_) marks_[slot] = cell_mark::kFree;
    // The mark of a cell is the permutation of its vertices from here on.
    parallel_for_each(slots, kGrain, [&](std::size_t c) {
        if (marks_[c] == cell_mark::kFree) return;
        const std::array<int, 4> v = cells_.vertices[c];
        const int n = even_permutation_of(v);
        marks_[c] = static_cast<char>(n);
        for (int j = 0; j < 4; ++j) cells_.vertices[c][j] = v[kEven.from[n][j]];
    });
    const auto for_each_cell = [&](const auto& visit) {
        for (std::size_t c = 0; c < slots; ++c)
            if (marks_[c] != cell_mark::kFree) visit(static_cast<int>(c), cells_.vertices[c][0]);
    };
    std::vector<int> end(points.size() + 1, 0);  // of the cells that have a vertex first
    for_each_cell([&](int, int vertex) { ++end[vertex + 1]; });
    std::partial_sum(end.begin(), end.end(), end.begin());
    const std::size_t cells = end.back();
    std::vector<int> order(cells), number(slots);
    for_each_cell([&](int c, int vertex) { order[end[vertex]++] = c; });
    parallel_for_each(points.size(), kGrain, [&](std::size_t v) {
        // By their next two vertices: an oriented facet has one cell behind it.
        thread_local std::vector<std::pair<std::uint64_t, int>> those;
        those.clear();
        const int begin = v == 0 ? 0 : end[v - 1];
        for (int n = begin; n < end[v]; ++n) {
            const auto next = static_cast<unsigned>(cells_.vertices[order[n]][1]),
                       after = static_cast<unsigned>(cells_.vertices[order[n]][2]);
            those.emplace_back(std::uint64_t{next} << 32 | after, order[n]);
        }
        std::sort(those.begin(), those.end());
        int n = begin;
        for (const auto& [key, c] : those) {
            order[n] = c;
            number[c] = n++;
        }
    });
    parallel_for_each(slots, kGrain, [&](std::size_t c) {
        if (marks_[c] == cell_mark::kFree) return;
        const std::array<int, 4> links = cells_.links[c];
        const int n = marks_[c];
        for (int j = 0; j < 4; ++j) {
            const int link = links[kEven.from[n][j]], other = link >> 2, m = marks_[other];
            cells_.links[c][j] = Tetrahedra::link(number[other], kEven.to[m][link & 3]);
        }
    });
    // One number of each after the other, for with all twice a DT would take its most memory here; and back,
    // so that each stays where it is: places that change would leave holes.
    std::vector<int>& ordered = number;
    const auto put_in_order = [&](std::vector<std::array<int, 4>>& values) {
        for (int k = 0; k < 4; ++k) {
            parallel_for_each(cells, kGrain, [&](std::size_t n) { ordered[n] = values[order[n]][k]; });
            parallel_for_each(cells, kGrain, [&](std::size_t n) { values[n][k] = ordered[n]; });
        }
        values.resize(cells);
    };
    put_in_order(cells_.vertices);
    put_in_order(cells_.links);
    marks_.assign(cells, cell_mark::kUnseen);
    free_.clear();
}

}  // namespace isotrack
