// The triangles near a place, in a mesh that changes a little.
#pragma once

#include <memory>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Triangles by their bounding boxes. Threads may share `meeting`, but not `note`.
class TriangleBoxes {
public:
    /// Some of a mesh. Points and triangles must outlive it; after one of these, or a vertex of it, changed
    /// `note` must be told.
    TriangleBoxes(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                  const std::vector<int>& some);
    /// All.
    TriangleBoxes(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles);
    ~TriangleBoxes();

    void note(int changed_triangle);
    /// The triangles whose boxes meet this one, ascending.
    std::vector<int> meeting(const Box& box) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace isotrack
