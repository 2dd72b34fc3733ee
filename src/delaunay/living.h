// CGAL's Delaunay triangulation, with vertices by number and a flat copy that follows every change.
#pragma once

#include <memory>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"

namespace isotrack {

/// A DT that is changed in place. Not for concurrent use.
class LivingDelaunay {
public:
    LivingDelaunay();
    ~LivingDelaunay();

    /// Starts anew with vertex i at points[i], where `there` (all when empty) is set; of several points on
    /// one place one has a vertex.
    void assign(const std::vector<Vec3>& points, const std::vector<char>& there = {});
    /// False when another vertex is on that very place; the number has then no vertex. `near`: the number of
    /// a vertex close by, or -1.
    bool insert(int number, const Vec3& p, int near);
    void remove(int number);
    /// Inserts at p, then removes from where it was: faster than the other way round (the paper's 4.3).
    void relocate(int number, const Vec3& p);
    bool has(int number) const;
    std::size_t size() const;  ///< Vertices.

    /// Vertex i becomes to[i]; to[i] < 0: there is none.
    void renumber(const std::vector<int>& to);

    Vec3 position(int number) const;
    /// Sets a position as it is; the triangulation around it may be none any more.
    void set_position(int number, const Vec3& p);

    enum class Star { Delaunay, EmbeddedOnly, Broken };
    /// What the cells around a vertex would be with the vertex at p: all positively oriented and each locally
    /// Delaunay with its neighbours (on the hull: convex), only the first, or neither.
    Star star_at(int number, const Vec3& p);

    void neighbours(int number, std::vector<int>& result) const;

    /// Slots that hold no cell any more have only infinite vertices and are their own neighbours.
    const Tetrahedra& cells();
    /// The slots of `cells()` written since the last call, ascending; `assign` writes all.
    std::vector<int> take_changed();

    const UpdateProfile& profile() const;  ///< Since the first `assign`.

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace isotrack
