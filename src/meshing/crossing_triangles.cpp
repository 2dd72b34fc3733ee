#include "meshing/crossing_triangles.h"

#include "isotrack/meshing/self_intersections.h"
#include "meshing/box_tree.h"
#include "meshing/triangle_box.h"

namespace isotrack {

std::vector<char> crossing_triangles(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                     const std::vector<char>& fresh) {
    // Only what is in the box of a fresh triangle can cross it.
    const BoxTree tree(points, triangles, fresh);
    std::vector<Triangle> near;
    std::vector<std::size_t> of;  // triangle of each that is near
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        bool is_near = false;
        tree.for_each_meeting(box_of(points, triangles[t]), [&](int) { is_near = true; });
        if (!is_near) continue;
        near.push_back(triangles[t]);
        of.push_back(t);
    }
    std::vector<char> crossing(triangles.size(), 0);
    for (const auto& pair : self_intersections(points, near))
        for (const int t : {pair.first, pair.second}) crossing[of[t]] = 1;
    return crossing;
}

}  // namespace isotrack
