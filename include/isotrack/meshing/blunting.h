// Sharp triangles made blunter, by the other diagonal or by moving a corner along the surface.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "isotrack/surface/crossing_grid.h"
#include "isotrack/types.h"

namespace isotrack {

/// One change: a flip of the edge between two triangles, or a move of one vertex.
struct Blunting {
    std::vector<int> triangle;     ///< Those concerned.
    std::vector<Triangle> before;  ///< Of each: its corners, which only a flip changes.
    int vertex = -1;               ///< That moved, or -1.
    Vec3 from = Vec3::Zero();      ///< Where it was.
};

class TriangleBoxes;
struct Proposal;

/// Makes the sharp triangles of a mesh blunter. The mesh must be closed, oriented, manifold and free of
/// crossings, and stays so; its topology does not change. Uses TBB inside; the result does not depend on the
/// number of threads.
class Blunter {
public:
    /// `reached`: points of the surface, such as its lattice crossings, for triangles to stand for; more may
    /// come between runs. `detail`: that of `certified_error`; unset: the surface's resolution. All but
    /// `movable` (one entry per point) must outlive it; nobody else may change the mesh meanwhile.
    Blunter(std::vector<Vec3>& points, std::vector<Triangle>& triangles, std::vector<char> movable,
            const Surface& surface, const std::vector<const CrossingGrid*>& reached, double tolerance,
            std::optional<double> detail = {});
    ~Blunter();

    /// Looks at the triangles with an angle below 30 degrees, sharpest first, but for those that were looked
    /// at in vain and have not changed since; so often, or until nothing changes. Flips the longest edge, or
    /// moves a corner that is movable along the surface; of triangles shorter than half a detail only in so
    /// many tries. Its height above it is kept; one of a hundredth of `tolerance` or more may
    /// become a quarter of that higher or lower where it must. A change is made where the smallest angle of
    /// the triangles concerned grows by a tenth or more or to 30 degrees, and all of them face the way the
    /// surface does (at a corner or the centroid), or no worse than before, are within `tolerance` of it,
    /// leave nothing that they stood for farther from the mesh than that and than it was, and cross no other
    /// triangle. Below 18 degrees corners may leave the surface, too. Points that move keep no more digits
    /// than floats. Returns whether anything changed.
    bool run(int passes);

    /// Takes back the changes of which a triangle's box is within `distance` of one of these places, and what
    /// was changed upon them; all, if there is none. Their vertices only move for what is very sharp from
    /// then on. Returns whether there was anything to take back.
    bool undo_near(const std::vector<Vec3>& places, double distance);

    /// All that was changed and not taken back.
    const std::vector<Blunting>& changes() const { return changes_; }
    /// Points and triangles as they were before these.
    std::pair<std::vector<Vec3>, std::vector<Triangle>> before() const;

private:
    bool pass();
    void make(Proposal&& proposal, std::vector<char>& touched);
    void undo(const std::vector<char>& marked);
    bool undo_crossing();  // whether there was any

    std::vector<Vec3>& points_;
    std::vector<Triangle>& triangles_;
    std::vector<char> movable_, fixed_;  // fixed: a move was taken back
    const Surface& surface_;
    const std::vector<const CrossingGrid*>& reached_;
    double tolerance_, detail_;
    std::vector<char> open_;       // per vertex: triangles around it are to be looked at
    std::vector<char> unchecked_;  // per triangle: changed since crossings were looked for
    std::vector<char> searched_;   // per triangle: in vain, as it is
    long short_ones_left_;         // so many moves are still tried for triangles of less than half a detail
    std::vector<Blunting> changes_;
    std::set<std::pair<int, int>> lost_;  // edges that were flipped: taking that back brings them back
    std::once_flag made_boxes_;
    std::unique_ptr<TriangleBoxes> boxes_;
};

}  // namespace isotrack
