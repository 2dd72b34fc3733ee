// One vertex more in a DT.
#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <unordered_map>
#include <vector>

#include "delaunay/filters.h"
#include "isotrack/delaunay/tetrahedralisation.h"

namespace isotrack {

/// What a slot for a cell may be marked as. Who adds a vertex has two marks of its own, for the cells that go
/// and for those around them.
namespace cell_mark {
constexpr char kUnseen = 0;              ///< A cell that nobody is at.
constexpr char kFree = -1;               ///< A slot without a cell.
constexpr char kConflict = 1, kRim = 2;  ///< Of the first one to add vertices; the next has the next two.
constexpr int kMostWorkers = 60;         ///< That have marks of their own.
static_assert(kRim == kConflict + 1 && kRim + 2 * (kMostWorkers - 1) <= 127);
}  // namespace cell_mark

/// The marks where one thread alone adds vertices.
class LoneMarks {
public:
    static constexpr bool kShared = false;
    static constexpr char conflict = cell_mark::kConflict, rim = cell_mark::kRim;
    explicit LoneMarks(char* marks) : marks_(marks) {}

    char of(int cell) const { return marks_[cell]; }
    void set(int cell, char mark) { marks_[cell] = mark; }
    bool seize(int) { return true; }
    void release(int) {}

private:
    char* marks_;
};

/// The marks where several threads do: nobody reads or writes a cell that another has marked. By the
/// compiler's own functions: C++17 has no atomic access to a part of an array that is a plain one at other
/// times.
class SharedMarks {
public:
    static constexpr bool kShared = true;
    const char conflict, rim;
    /// Of one worker, by number.
    SharedMarks(char* marks, int worker)
        : conflict(static_cast<char>(cell_mark::kConflict + 2 * worker)),
          rim(static_cast<char>(cell_mark::kRim + 2 * worker)),
          marks_(marks) {}

    char of(int cell) const { return __atomic_load_n(marks_ + cell, __ATOMIC_RELAXED); }
    void set(int cell, char mark) { __atomic_store_n(marks_ + cell, mark, __ATOMIC_RELAXED); }
    /// Marks a cell that nobody is at; waits a moment for others. False where it is still theirs then.
    bool seize(int cell) {
        constexpr int kPatience = 1000;  // about a microsecond: some of what it takes to add a vertex
        for (int turn = 0; turn < kPatience; ++turn) {
            char mark = of(cell);
            if (mark == cell_mark::kUnseen &&
                __atomic_compare_exchange_n(marks_ + cell, &mark, conflict, false, __ATOMIC_ACQUIRE,
                                            __ATOMIC_RELAXED))
                return true;
        }
        return false;
    }
    void release(int cell) { __atomic_store_n(marks_ + cell, cell_mark::kUnseen, __ATOMIC_RELEASE); }

private:
    char* const marks_;
};

/// The arrays that an insertion works with, to be kept from one to the next. Each thread has its own.
struct InsertionRoom {
    struct Facet {
        int cell, k;
    };
    std::vector<int> fresh, freed;  ///< Slots of the cells that came and went.
    std::vector<Facet> rim;         ///< Around those that went.
    std::vector<int> corners, corner_of, edges;
    std::vector<std::array<int, 3>> on_rim;  ///< The corners of each facet of the rim.
};

/// Bowyer's and Watson's step. `Marks`: `LoneMarks` or `SharedMarks`.
template <typename Marks>
class Insertion {
public:
    static constexpr int kBlocked = -1;  // by another thread

    Insertion(const std::vector<Vec3>& points, Tetrahedra& cells, Marks marks, InsertionRoom& room)
        : points_(points), cells_(cells), marks_(marks), room_(room) {}

    /// A cell that has the place of a vertex in it or on it, infinite when it is outside the hull; it is
    /// seized. `kBlocked` where another thread is on the way. `start`: a cell near by.
    int locate(const Vec3& p, int start) {
        int cell = start, from = -1;
        if (!marks_.seize(cell)) return kBlocked;
        const auto step = [&](int next) {
            const bool seized = marks_.seize(next);
            marks_.release(cell);
            cell = next;
            return seized;
        };
        if (infinite(cells_.vertices[cell]) &&
            !step(cells_.neighbour(cell, index_in(cells_.vertices[cell], Tetrahedra::kInfinite))))
            return kBlocked;
        for (;;) {
            const auto& v = cells_.vertices[cell];
            if (infinite(v)) return cell;
            int exit = -1;
            for (int k = 0; k < 4 && exit < 0; ++k) {
                if (k == from) continue;
                const Vec3* q[4] = {&points_[v[0]], &points_[v[1]], &points_[v[2]], &points_[v[3]]};
                q[k] = &p;
                if (filtered_orientation(*q[0], *q[1], *q[2], *q[3]) < 0) exit = k;
            }
            if (exit < 0) return cell;
            const int link = cells_.links[cell][exit];
            from = link & 3;
            if (!step(link >> 2)) return kBlocked;
        }
    }

    /// Whether it is a cell that nobody is at.
    bool is_unseen(int cell) const { return marks_.of(cell) == cell_mark::kUnseen; }

    /// The vertex of `cell` at p, or -1.
    int vertex_at(const Vec3& p, int cell) const {
        for (const int v : cells_.vertices[cell])
            if (v >= 0 && points_[v] == p) return v;
        return -1;
    }

    /// Finds the cells in conflict with the vertex, `freed`, and the facets around them, `rim`. False, and
    /// nothing is seized any more, where another thread is in the way.
    bool dig(int vertex, int cell) {
        const Vec3& p = points_[vertex];
        auto& freed = room_.freed;
        auto& rim = room_.rim;
        // What may belong to a list is written to its end in any case, and counted if it does: a branch on it
        // could not be predicted.
        constexpr std::size_t kRoom = 64;  // more than most holes need
        if (freed.size() < kRoom) freed.resize(kRoom);
        if (rim.size() < kRoom) rim.resize(kRoom);
        std::size_t in_hole = 0, in_rim = 0;
        bool blocked = false;
        // Locals, because a write to a char might be one to anything else.
        Marks marks = marks_;
        const auto* const links = cells_.links.data();
        int* hole = freed.data();  // links: into the cells in conflict, each from the one it was found from
        InsertionRoom::Facet* around = rim.data();
        const auto cross = [&](int from, int k) {
            if (Marks::kShared && blocked) return;  // nothing more is of use
            const int link = links[from][k], other = link >> 2;
            char mark = marks.of(other);
            if (Marks::kShared ? !is_own(mark, marks) : mark == cell_mark::kUnseen) {
                if (!marks.seize(other)) {
                    blocked = true;
                    return;
                }
                const bool conflict = in_conflict(other, p, marks, blocked);
                mark = static_cast<char>(marks.rim - conflict);
                marks.set(other, mark);
                hole[in_hole] = link;
                in_hole += conflict;
            }
            around[in_rim] = {from, k};
            in_rim += mark == marks.rim;
        };
        constexpr int kOthers[4][3] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};
        marks.set(cell, marks.conflict);
        hole[in_hole++] = Tetrahedra::link(cell, 0);  // as if found across facet 0, so that is crossed here
        cross(cell, 0);
        std::size_t i = 0;
        for (; i < in_hole && !blocked; ++i) {
            if (in_hole + 3 > freed.size()) {
                freed.resize(2 * freed.size());
                hole = freed.data();
            }
            if (in_rim + 3 > rim.size()) {
                rim.resize(2 * rim.size());
                around = rim.data();
            }
            const int from = hole[i] >> 2, back = hole[i] & 3;
            for (const int k : kOthers[back]) cross(from, k);
            hole[i] = from;
        }
        for (; i < in_hole; ++i) hole[i] >>= 2;
        freed.resize(in_hole);
        rim.resize(in_rim);
        if (blocked) give_up();
        return !blocked;
    }

    /// After `dig`, instead of `fill`: leaves all as it was.
    void give_up() {
        for (const auto& facet : room_.rim) release_rim(cells_.neighbour(facet.cell, facet.k));
        for (const int cell : room_.freed) marks_.release(cell);
    }

    /// After `dig`: a cell on every facet of the rim, into the slots `fresh`, of which there must be as many
    /// and which nobody can seize. What was seized is released, but the cells of the slots in `freed` stay
    /// there, and their marks.
    void fill(int vertex) {
        // The new cells meet at the facets between the new vertex and the edges of the rim, each of which two
        // facets have, in opposite directions.
        const std::size_t count = room_.rim.size() / 2 + 2;  // of vertices on the rim, by Euler's formula
        constexpr std::size_t kMostInTable = 256;            // a vertex far outside sees half the hull
        if (count <= kMostInTable) {
            if (room_.edges.size() < count * count) room_.edges.resize(count * count);
            int* const table = room_.edges.data();
            connect(vertex, count, [&](int from, int to) -> int& { return table[count * from + to]; });
        } else {
            std::unordered_map<std::size_t, int> many;
            connect(vertex, count, [&](int from, int to) -> int& { return many[count * from + to]; });
        }
    }

    static bool infinite(const std::array<int, 4>& v) { return (v[0] | v[1] | v[2] | v[3]) < 0; }
    static int index_in(const std::array<int, 4>& v, int vertex) {
        return (v[1] == vertex) + 2 * (v[2] == vertex) + 3 * (v[3] == vertex);  // no branches to mispredict
    }

    /// Is p inside the cell's sphere, or beyond the facet of an infinite cell?
    bool in_conflict(int cell, const Vec3& p) {
        bool blocked = false;
        return in_conflict(cell, p, marks_, blocked);
    }

private:
    static bool is_own(char mark, const Marks& marks) { return mark == marks.conflict || mark == marks.rim; }

    bool in_conflict(int cell, const Vec3& p, Marks& marks, bool& blocked) const {
        const auto& v = cells_.vertices[cell];
        if (!infinite(v))
            return filtered_in_sphere(points_[v[0]], points_[v[1]], points_[v[2]], points_[v[3]], p);
        const int k = index_in(v, Tetrahedra::kInfinite);
        const Vec3* q[4] = {&p, &p, &p, &p};
        for (int j = 0; j < 4; ++j)
            if (j != k) q[j] = &points_[v[j]];
        const int side = filtered_orientation(*q[0], *q[1], *q[2], *q[3]);
        if (side != 0) return side > 0;
        // In the plane of the facet the circle decides, in which that plane cuts the sphere of the cell
        // behind it.
        const int behind = cells_.neighbour(cell, k);
        const bool seizes = Marks::kShared && !is_own(marks.of(behind), marks);
        if (seizes && !marks.seize(behind)) {
            blocked = true;
            return false;
        }
        const bool result = in_conflict(behind, p, marks, blocked);
        if (seizes) marks.release(behind);
        return result;
    }

    /// Makes the cells of `fresh`, one on every facet of the rim. `edge(a, b)` is a place for the link across
    /// the edge from the a-th of the `count` vertices on the rim to the b-th.
    template <typename Edge>
    void connect(int vertex, std::size_t count, const Edge& edge) {
        constexpr int kNone = -1;
        auto& rim = room_.rim;
        auto& on_rim = room_.on_rim;
        if (room_.corner_of.size() < points_.size() + 1) room_.corner_of.resize(points_.size() + 1, kNone);
        room_.corners.resize(count);
        on_rim.resize(rim.size());
        int* const corner_of = room_.corner_of.data() + 1;  // the infinite vertex may be on the rim
        int* const corners = room_.corners.data();
        const int* const fresh = room_.fresh.data();
        Marks marks = marks_;
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
        for (std::size_t i = 0; i < rim.size(); ++i) {
            const InsertionRoom::Facet facet = rim[i];
            const auto& f = Tetrahedra::kFacet[facet.k];
            const int slot = fresh[i], outside = links[facet.cell][facet.k];
            std::array<int, 4> v = vertices[facet.cell];
            const std::array<int, 3> c{corner(v[f[0]]), corner(v[f[1]]), corner(v[f[2]])};
            on_rim[i] = c;
            v[facet.k] = vertex;
            vertices[slot] = v;
            links[slot][facet.k] = outside;
            links[outside >> 2][outside & 3] = Tetrahedra::link(slot, facet.k);
            rim[i].cell = outside >> 2;  // to be released when all is done
            if (!Marks::kShared) marks.set(slot, cell_mark::kUnseen);
            if (!Marks::kShared) marks.set(outside >> 2, cell_mark::kUnseen);
            for (int j = 0; j < 3; ++j) edge(c[j], c[(j + 1) % 3]) = Tetrahedra::link(slot, f[(j + 2) % 3]);
        }
        assert(static_cast<std::size_t>(found) == count);
        for (std::size_t i = 0; i < rim.size(); ++i) {
            const auto& f = Tetrahedra::kFacet[rim[i].k];
            const auto& c = on_rim[i];
            auto& own = links[fresh[i]];
            for (int j = 0; j < 3; ++j) own[f[(j + 2) % 3]] = edge(c[(j + 1) % 3], c[j]);
        }
        for (const int w : room_.corners) corner_of[w] = kNone;
        if (Marks::kShared) {  // not before: others look for a cell by the number of its slot
            for (std::size_t i = 0; i < rim.size(); ++i) marks.release(fresh[i]);
            for (const auto& facet : rim) release_rim(facet.cell);
        }
    }

    /// A cell may have several facets of the rim, and be somebody else's as soon as it is released.
    void release_rim(int cell) {
        if (marks_.of(cell) == marks_.rim) marks_.release(cell);
    }

    const std::vector<Vec3>& points_;
    Tetrahedra& cells_;
    Marks marks_;
    InsertionRoom& room_;
};

}  // namespace isotrack
