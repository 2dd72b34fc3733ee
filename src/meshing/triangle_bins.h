// The triangles of a mesh by where they are.
#pragma once

#include <algorithm>
#include <vector>

#include "isotrack/types.h"
#include "meshing/triangle_box.h"

namespace isotrack {

/// In cubes of one size. Read-only, so threads may share it.
class TriangleBins {
public:
    /// Both vectors must outlive it. `size`: the least edge of a cube; more for large triangles, and so that
    /// there are no more cubes than a few for each triangle. Uses TBB inside.
    TriangleBins(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles, double size);

    const std::vector<Vec3>& points() const { return points_; }
    const std::vector<Triangle>& triangles() const { return triangles_; }
    Box box_of(int triangle) const { return isotrack::box_of(points_, triangles_[triangle]); }

    /// Those whose boxes meet this one, ascending.
    std::vector<int> meeting(const Box& box) const;

private:
    struct Range {
        Eigen::Array3i from, to;  // inclusive
    };
    Range range_of(const Box& box) const;
    std::size_t number(int x, int y, int z) const {
        return (static_cast<std::size_t>(x) * count_.y() + y) * count_.z() + z;
    }

    const std::vector<Vec3>& points_;
    const std::vector<Triangle>& triangles_;
    Vec3 low_ = Vec3::Zero();
    double size_;
    Eigen::Array3i count_ = {1, 1, 1};
    std::vector<int> first_, members_;  // of each cube, and the end
};

}  // namespace isotrack
