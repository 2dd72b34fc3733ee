// The incremental construction of a DT.
#pragma once

#include <array>
#include <vector>

#include "delaunay/insertion.h"
#include "isotrack/delaunay/tetrahedralisation.h"

namespace isotrack {

/// A DT that grows by vertices (Bowyer 1981, Watson 1981): the cells whose spheres hold the
/// new vertex make room for those between it and the rim of the hole. Where more than four vertices are on a
/// sphere `in_sphere` decides, so that the DT depends on the points alone, not on their order.
/// Not for concurrent use.
class IncrementalDelaunay {
public:
    /// Position by vertex. To be grown by the owner, before `insert`; a vertex may move where its cells stay
    /// Delaunay.
    std::vector<Vec3> points;

    const Tetrahedra& cells() const { return cells_; }
    bool empty() const { return cells_.size() == 0; }

    /// The DT of the vertices in `chosen`, from which those are taken that are on the place of another; none
    /// are taken and there are no cells when they span no volume. `threads`: so many add vertices at most, 0
    /// for all that there are; then the slots of the cells depend on the hour, until `arrange`.
    void build(std::vector<int>& chosen, int threads);
    /// After `build`: leaves no slot free, makes cells neighbours in memory as far as their vertices are, and
    /// their numbers and the order of their vertices depend on the points alone.
    void arrange();

    /// A cell that has the place of a vertex in it or on it, infinite when it is outside the hull. `start`: a
    /// cell near by.
    int locate(const Vec3& p, int start);
    /// The vertex of `cell` at p, or -1.
    int vertex_at(const Vec3& p, int cell);

    /// Adds a vertex, located in `cell` and not at a vertex of it. `fresh()` and `freed()` are then the slots
    /// of the cells that came and went.
    void insert(int vertex, int cell);
    const std::vector<int>& fresh() const { return room_.fresh; }
    const std::vector<int>& freed() const { return room_.freed; }

    /// Is p inside the cell's sphere, or beyond the facet of an infinite cell?
    bool in_conflict(int cell, const Vec3& p);

    /// For changes from outside: a slot to write to, one that is given back, and the arrays themselves.
    int new_slot();
    void free_slot(int slot);
    Tetrahedra& slots() { return cells_; }

private:
    bool start(const std::vector<int>& order, std::array<int, 4>& first);
    bool start_anew(const std::vector<int>& order, std::size_t room, std::array<int, 4>& first);
    std::vector<int> add(const int* begin, const int* end, int near);
    bool add_simultaneously(const std::vector<int>& order, int threads);
    void fill_hole(int vertex, int cell);
    void blank(int slot);
    Insertion<LoneMarks> insertion() { return {points, cells_, LoneMarks(marks_.data()), room_}; }

    Tetrahedra cells_;
    std::vector<int> free_;
    std::vector<char> marks_;
    InsertionRoom room_;
};

}  // namespace isotrack
