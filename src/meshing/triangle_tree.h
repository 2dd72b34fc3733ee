// The triangles of a mesh by where they are.
#pragma once

#include <algorithm>
#include <vector>

#include "isotrack/types.h"
#include "meshing/box_tree.h"
#include "meshing/triangle_box.h"

namespace isotrack {

/// Read-only, so threads may share it. Points must be finite.
class TriangleTree {
public:
    /// Both vectors must outlive it. Uses TBB inside, as the others do.
    TriangleTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles);
    /// In a fraction of the time: of what became of the mesh of another tree, which was not made `in_order`.
    /// Of its triangles `gone`, ascending, are not there any more, the others have kept their order, and
    /// behind them is what came. Nothing but the order of `before` is read: its mesh may be this one already.
    TriangleTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                 const TriangleTree& before, const std::vector<int>& gone);
    /// In less time and memory, for triangles of which those that follow each other are near each other.
    static TriangleTree in_order(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles);

    const std::vector<Vec3>& points() const { return points_; }
    const std::vector<Triangle>& triangles() const { return triangles_; }
    Box box_of(int triangle) const { return isotrack::box_of(points_, triangles_[triangle]); }

    /// Those whose boxes meet this one, ascending.
    std::vector<int> meeting(const Box& box) const;
    /// Calls `visit(t)` with these and maybe some that are near, in any order, each once.
    template <typename Visit>
    void for_each_near(const Box& box, const Visit& visit) const {
        boxes_.for_each_meeting(box, [&](int run) {
            const int begin = run * run_length_, count = static_cast<int>(triangles_.size());
            for (int t = begin; t < std::min(begin + run_length_, count); ++t) visit(t);
        });
    }

private:
    TriangleTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                 const std::vector<int>& order, int run_length);

    const std::vector<Vec3>& points_;
    const std::vector<Triangle>& triangles_;
    const int run_length_;
    BoxTree boxes_;  // of runs of so many triangles
};

}  // namespace isotrack
