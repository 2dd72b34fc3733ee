#include <algorithm>
#include <utility>

#include "meshing/blunting.h"

namespace isotrack {

std::optional<Blunting> flip(BluntedMesh& mesh, int triangle, double sharpness) {
    const auto& points = mesh.points;
    auto& triangles = mesh.triangles;
    const auto beyond = [&](int v, int w) { return mesh.corners.beyond(v, w, triangles); };
    const Triangle& old = triangles[triangle];
    int k = 0;
    double longest = 0.0;
    for (int i = 0; i < 3; ++i) {
        const double length2 = (points[old[(i + 1) % 3]] - points[old[(i + 2) % 3]]).squaredNorm();
        if (length2 > longest) {
            longest = length2;
            k = i;
        }
    }
    auto& touched = mesh.touched;
    const int a = old[k], b = old[(k + 1) % 3], c = old[(k + 2) % 3];
    if (touched[a] || touched[b] || touched[c]) return std::nullopt;
    const auto [d, other] = beyond(c, b);
    if (d < 0 || d == a || touched[d]) return std::nullopt;
    if (beyond(a, d).second >= 0 || beyond(d, a).second >= 0 || mesh.lost.count(std::minmax(a, d)) > 0)
        return std::nullopt;
    const Triangle first = {a, b, d}, second = {a, d, c};
    const double before = std::max(sharpness, mesh.sharpness_of(triangles[other]));
    if (!(std::max(mesh.sharpness_of(first), mesh.sharpness_of(second)) < worth(before))) return std::nullopt;
    if (!mesh.may_have({first, second}, mesh.replaced({triangle, other}))) return std::nullopt;
    Blunting result{{triangle, other}, {old, triangles[other]}};
    mesh.lost.insert(std::minmax(b, c));
    triangles[triangle] = first;
    triangles[other] = second;
    for (const int v : {a, b, c, d}) touched[v] = 1;
    return result;
}

}  // namespace isotrack
