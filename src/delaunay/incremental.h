// The incremental construction of a DT.
#pragma once

#include <array>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"

namespace isotrack {

/// A DT that grows by one vertex after another (Bowyer 1981, Watson 1981): the cells whose spheres hold the
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
    /// are taken and there are no cells when they span no volume.
    void build(std::vector<int>& chosen);
    /// After `build`: leaves no slot free and makes cells neighbours in memory as far as their vertices are.
    void arrange();

    /// A cell that has the place of a vertex in it or on it, infinite when it is outside the hull. `start`: a
    /// cell near by.
    int locate(const Vec3& p, int start) const;
    /// The vertex of `cell` at p, or -1.
    int vertex_at(const Vec3& p, int cell) const;

    /// Adds a vertex, located in `cell` and not at a vertex of it. `fresh()` and `freed()` are then the slots
    /// of the cells that came and went.
    void insert(int vertex, int cell);
    const std::vector<int>& fresh() const { return fresh_; }
    const std::vector<int>& freed() const { return freed_; }

    /// Is p inside the cell's sphere, or beyond the facet of an infinite cell?
    bool in_conflict(int cell, const Vec3& p) const;

    /// For changes from outside: a slot to write to, one that is given back, and the arrays themselves.
    int new_slot();
    void free_slot(int slot);
    Tetrahedra& slots() { return cells_; }

private:
    bool start(const std::vector<int>& order, std::array<int, 4>& first);
    void dig(int vertex, int cell);
    void fill_hole(int vertex, int cell);
    template <typename Edge>
    void connect(int vertex, std::size_t count, const Edge& edge);
    void blank(int slot);

    Tetrahedra cells_;
    std::vector<int> free_;
    std::vector<char> marks_;
    struct Facet {
        int cell, k;
    };
    std::vector<Facet> rim_;
    std::vector<int> fresh_, freed_;
    std::vector<int> corners_, corner_of_, edges_;
    std::vector<std::array<int, 3>> on_rim_;  // the corners of each facet of the rim
};

}  // namespace isotrack
