#include "meshing/crossing_triangles.h"

#include <algorithm>
#include <limits>

#include "isotrack/meshing/self_intersections.h"
#include "meshing/triangle_bins.h"

namespace isotrack {

std::vector<char> crossing_triangles(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                     const std::vector<char>& fresh) {
    // Only what is in the box of a fresh triangle can cross it.
    std::vector<Triangle> some;
    Box around;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        if (!fresh[t]) continue;
        some.push_back(triangles[t]);
        around.extend(box_of(points, triangles[t]));
    }
    // As large as they are; those that are all points have no size.
    const double size = std::max(1e-6 * around.diagonal().norm(), std::numeric_limits<double>::min());
    const TriangleBins bins(points, some, size);
    std::vector<Triangle> near;
    std::vector<std::size_t> of;  // triangle of each that is near
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const Box box = box_of(points, triangles[t]);
        if (!around.intersects(box) || !bins.any_meets(box)) continue;
        near.push_back(triangles[t]);
        of.push_back(t);
    }
    std::vector<char> crossing(triangles.size(), 0);
    for (const auto& pair : self_intersections(points, near))
        for (const int t : {pair.first, pair.second}) crossing[of[t]] = 1;
    return crossing;
}

}  // namespace isotrack
