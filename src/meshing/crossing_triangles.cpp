#include "meshing/crossing_triangles.h"

#include <algorithm>

#include "isotrack/meshing/self_intersections.h"
#include "meshing/triangle_box.h"

namespace isotrack {

std::vector<char> crossing_triangles(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                     const std::vector<char>& fresh) {
    // Only what is in the box of a fresh triangle can cross it.
    std::vector<Box> places;
    double widest = 0.0;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        if (!fresh[t]) continue;
        places.push_back(box_of(points, triangles[t]));
        widest = std::max(widest, places.back().sizes().x());
    }
    std::sort(places.begin(), places.end(),
              [](const Box& a, const Box& b) { return a.min().x() < b.min().x(); });
    TriangleMesh near;
    near.points = points;
    std::vector<std::size_t> of;  // triangle of each that is near
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const Box box = box_of(points, triangles[t]);
        auto place = std::lower_bound(places.begin(), places.end(), box.min().x() - widest,
                                      [](const Box& p, double x) { return p.min().x() < x; });
        while (place != places.end() && place->min().x() <= box.max().x() && !place->intersects(box)) ++place;
        if (place == places.end() || place->min().x() > box.max().x()) continue;
        near.triangles.push_back(triangles[t]);
        of.push_back(t);
    }
    std::vector<char> crossing(triangles.size(), 0);
    for (const auto& pair : self_intersections(near))
        for (const int t : {pair.first, pair.second}) crossing[of[t]] = 1;
    return crossing;
}

}  // namespace isotrack
