#include <algorithm>
#include <utility>

#include "meshing/blunting.h"

namespace isotrack {

std::optional<Proposal> flip(const BluntedMesh& mesh, int triangle, double sharpness, Surface::Probe& probe) {
    const auto& points = mesh.points;
    const auto& triangles = mesh.triangles;
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
    const auto& touched = mesh.touched;
    const int a = old[k], b = old[(k + 1) % 3], c = old[(k + 2) % 3];
    if (touched[a] || touched[b] || touched[c]) return std::nullopt;
    const auto [d, other] = beyond(c, b);
    if (d < 0 || d == a || touched[d]) return std::nullopt;
    if (beyond(a, d).second >= 0 || beyond(d, a).second >= 0 || mesh.lost.count(std::minmax(a, d)) > 0)
        return std::nullopt;
    const Triangle first = {a, b, d}, second = {a, d, c};
    const double before = std::max(sharpness, mesh.sharpness_of(triangles[other]));
    if (!(std::max(mesh.sharpness_of(first), mesh.sharpness_of(second)) < worth(before))) return std::nullopt;
    if (!mesh.may_have({mesh.places_of(first), mesh.places_of(second)},
                       mesh.replaced({triangle, other}, probe), probe))
        return std::nullopt;
    Proposal result;
    result.change.triangle = {triangle, other};
    result.change.before = {old, triangles[other]};
    result.after = {first, second};
    result.lost = std::minmax(b, c);
    return result;
}

}  // namespace isotrack
