// A DT with vertices by number that is changed in place.
#pragma once

#include <vector>

#include "delaunay/incremental.h"
#include "isotrack/delaunay/tetrahedralisation.h"

namespace isotrack {

/// Changes cost by what they change, but for those that take a DT to or from points that span no volume and
/// the removal of one whose neighbours span none: these build anew. Not for concurrent use.
class LivingDelaunay {
public:
    /// Starts anew with vertex i at points[i], where `there` (all when empty) is set; of several points on
    /// one place one has a vertex, or all while there are no cells. `threads`: so many add vertices at most,
    /// 0 for all that there are.
    void assign(const std::vector<Vec3>& points, const std::vector<char>& there, int threads);
    /// Without vertices and cells, and frees their memory.
    void clear();
    /// False when another vertex is on that very place; the number has then no vertex. `near`: the number of
    /// a vertex close by, or -1.
    bool insert(int number, const Vec3& p, int near);
    void remove(int number);
    /// Inserts at p, then removes from where it was: faster than the other way round (the paper's 4.3). When
    /// another vertex is on that very place the number has none any more.
    void relocate(int number, const Vec3& p);
    bool has(int number) const { return number < static_cast<int>(there_.size()) && there_[number]; }
    std::size_t size() const { return size_; }  ///< Vertices.

    /// Vertex i becomes to[i] <= i; to[i] < 0: there is none.
    void renumber(const std::vector<int>& to);

    const Vec3& position(int number) const { return dt_.points[number]; }
    /// Sets a position as it is; the triangulation around it may be none any more.
    void set_position(int number, const Vec3& p) { dt_.points[number] = p; }

    enum class Star { Delaunay, EmbeddedOnly, Broken };
    /// What the cells around a vertex would be with the vertex at p: all positively oriented and each locally
    /// Delaunay with its neighbours (on the hull: convex), only the first, or neither.
    Star star_at(int number, const Vec3& p);

    void neighbours(int number, std::vector<int>& result) const;

    /// Slots that hold no cell any more have only infinite vertices and are their own neighbours.
    const Tetrahedra& cells() const { return dt_.cells(); }
    /// The slots of `cells()` written since the last call, ascending; building anew writes all.
    std::vector<int> take_changed();

    const UpdateProfile& profile() const { return profile_; }  ///< Since the first `assign`.

private:
    void rebuild(int threads = 1);  // one where few vertices are left, or the first ones come
    const std::vector<int>& star_of(int number) const;
    void place(int number, int cell);
    void note(const std::vector<int>& slots);
    bool fill_star(int number);

    IncrementalDelaunay dt_;
    std::vector<char> there_;  // by number: has a vertex
    std::vector<int> a_cell_;  // by number: one of its cells, while there are any
    int recent_ = 0;           // a cell, while there are any
    std::size_t size_ = 0;
    std::vector<int> changed_;
    UpdateProfile profile_;

    mutable std::vector<int> star_;
    mutable std::vector<char> in_star_;  // by slot
    IncrementalDelaunay hole_;
};

}  // namespace isotrack
