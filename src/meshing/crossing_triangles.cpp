#include "meshing/crossing_triangles.h"

#include "find_in_blocks.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/box_tree.h"
#include "meshing/triangle_box.h"

namespace isotrack {

std::vector<char> crossing_triangles(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                     const std::vector<char>& fresh) {
    // Only what is in the box of a fresh triangle can cross it.
    const BoxTree tree(points, triangles, fresh);
    constexpr std::size_t kBlock = 1024;
    const auto numbers = find_in_blocks<std::size_t>(
        triangles.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<std::size_t>& found) {
            for (std::size_t t = begin; t < end; ++t) {
                bool is_near = false;
                tree.for_each_meeting(box_of(points, triangles[t]), [&](int) { is_near = true; });
                if (is_near) found.push_back(t);
            }
        });
    std::vector<Triangle> near;
    for (const std::size_t t : numbers) near.push_back(triangles[t]);
    std::vector<char> crossing(triangles.size(), 0);
    for (const auto& pair : self_intersections(points, near))
        for (const int t : {pair.first, pair.second}) crossing[numbers[t]] = 1;
    return crossing;
}

}  // namespace isotrack
