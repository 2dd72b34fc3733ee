#include "isotrack/meshing/flips.h"

#include <algorithm>
#include <utility>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/corners.h"
#include "meshing/sharpness.h"

namespace isotrack {
namespace {

constexpr double kSharp = 1.7320508075688772;  // cotangent of 30 degrees
constexpr double kGain = 0.9;                  // of the cotangent, at most, for a flip to be worth it
constexpr double kFacing = 0.5;                // cosine to the surface normal, at least
constexpr int kSteps = 6;                      // barycentric lattice of the error samples

double sharpness_of(const std::vector<Vec3>& points, const Triangle& t) {
    return sharpness(points[t[0]], points[t[1]], points[t[2]]);
}

bool faces_outward(const std::vector<Vec3>& points, const Triangle& t, Surface::Probe& probe) {
    const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
    return (b - a).cross(c - a).normalized().dot(probe.normal((a + b + c) / 3.0)) > kFacing;
}

Box box_of(const std::vector<Vec3>& points, const Triangle& t) {
    Box box(points[t[0]]);
    box.extend(points[t[1]]);
    box.extend(points[t[2]]);
    return box;
}

/// The flips of which a triangle crosses another.
std::vector<char> crossing_flips(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                 const std::vector<Flip>& flips) {
    // Only what is in the box of a flipped triangle can cross it.
    struct Place {
        Box box;
        std::size_t flip;
    };
    std::vector<Place> places;
    double widest = 0.0;
    for (std::size_t f = 0; f < flips.size(); ++f)
        for (const int t : flips[f].triangle) {
            places.push_back({box_of(points, triangles[t]), f});
            widest = std::max(widest, places.back().box.sizes().x());
        }
    std::sort(places.begin(), places.end(),
              [](const Place& a, const Place& b) { return a.box.min().x() < b.box.min().x(); });
    TriangleMesh near;
    near.points = points;
    std::vector<std::size_t> of;  // triangle of each that is near
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const Box box = box_of(points, triangles[t]);
        auto place = std::lower_bound(places.begin(), places.end(), box.min().x() - widest,
                                      [](const Place& p, double x) { return p.box.min().x() < x; });
        while (place != places.end() && place->box.min().x() <= box.max().x() && !place->box.intersects(box))
            ++place;
        if (place == places.end() || place->box.min().x() > box.max().x()) continue;
        near.triangles.push_back(triangles[t]);
        of.push_back(t);
    }
    std::vector<int> flip_of(triangles.size(), -1);
    for (std::size_t f = 0; f < flips.size(); ++f)
        for (const int t : flips[f].triangle) flip_of[t] = static_cast<int>(f);
    std::vector<char> crossing(flips.size(), 0);
    for (const auto& pair : self_intersections(near))
        for (const int t : {pair.first, pair.second})
            if (const int f = flip_of[of[t]]; f >= 0) crossing[f] = 1;
    return crossing;
}

}  // namespace

std::vector<Flip> flip_sharp(const std::vector<Vec3>& points, std::vector<Triangle>& triangles,
                             const Surface& surface, double tolerance) {
    std::vector<std::pair<double, int>> sharp;
    for (std::size_t t = 0; t < triangles.size(); ++t)
        if (const double s = sharpness_of(points, triangles[t]); s > kSharp)
            sharp.emplace_back(-s, static_cast<int>(t));
    std::vector<Flip> flips;
    if (sharp.empty()) return flips;
    std::sort(sharp.begin(), sharp.end());
    const Corners corners(points.size(), triangles);
    /// The third vertex of the triangle with the edge from v to w, and that triangle.
    const auto beyond = [&](int v, int w) {
        for (int e = corners.first[v]; e < corners.first[v + 1]; ++e) {
            const int t = corners.corner[e] / 3, k = corners.corner[e] % 3;
            if (triangles[t][(k + 1) % 3] == w) return std::make_pair(triangles[t][(k + 2) % 3], t);
        }
        return std::make_pair(-1, -1);
    };
    std::vector<char> touched(points.size(), 0);
    const auto probe = surface.probe();
    for (const auto& [sharpest, t] : sharp) {
        int k = 0;
        double longest = 0.0;
        for (int i = 0; i < 3; ++i) {
            const double length2 =
                (points[triangles[t][(i + 1) % 3]] - points[triangles[t][(i + 2) % 3]]).squaredNorm();
            if (length2 > longest) {
                longest = length2;
                k = i;
            }
        }
        const int a = triangles[t][k], b = triangles[t][(k + 1) % 3], c = triangles[t][(k + 2) % 3];
        const auto [d, u] = beyond(c, b);
        if (d < 0 || d == a || touched[a] || touched[b] || touched[c] || touched[d]) continue;
        if (beyond(a, d).second >= 0 || beyond(d, a).second >= 0) continue;
        const Triangle first = {a, b, d}, second = {a, d, c};
        const double before = std::max(-sharpest, sharpness_of(points, triangles[u]));
        if (!(std::max(sharpness_of(points, first), sharpness_of(points, second)) < kGain * before)) continue;
        if (!faces_outward(points, first, *probe) || !faces_outward(points, second, *probe)) continue;
        const auto errors = triangle_errors(points, {first, second}, surface, kSteps, 0.5 * tolerance);
        if (errors[0].largest > tolerance || errors[1].largest > tolerance) continue;
        flips.push_back({{t, u}, {triangles[t], triangles[u]}});
        triangles[t] = first;
        triangles[u] = second;
        for (const int v : {a, b, c, d}) touched[v] = 1;
    }
    while (!flips.empty()) {
        const std::vector<char> crossing = crossing_flips(points, triangles, flips);
        std::vector<Flip> kept;
        for (std::size_t f = 0; f < flips.size(); ++f) {
            if (crossing[f])
                undo(flips[f], triangles);
            else
                kept.push_back(flips[f]);
        }
        const bool done = kept.size() == flips.size();
        flips = std::move(kept);
        if (done) break;
    }
    return flips;
}

void undo(const Flip& flip, std::vector<Triangle>& triangles) {
    for (int i = 0; i < 2; ++i) triangles[flip.triangle[i]] = flip.before[i];
}

}  // namespace isotrack
