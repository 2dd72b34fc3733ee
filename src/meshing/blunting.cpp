#include "meshing/blunting.h"

#include <algorithm>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/sharpness.h"

namespace isotrack {
namespace {

constexpr double kSharp = 1.7320508075688772;  // cotangent of 30 degrees
constexpr double kFacing = 0.5;                // cosine to the surface normal, at least
constexpr int kSteps = 6;                      // barycentric lattice of the error samples


Box box_of(const std::vector<Vec3>& points, const Triangle& t) {
    Box box(points[t[0]]);
    box.extend(points[t[1]]);
    box.extend(points[t[2]]);
    return box;
}

/// The changes of which a triangle crosses another.
std::vector<char> crossing_ones(const std::vector<Blunting>& changes, const std::vector<Vec3>& points,
                                const std::vector<Triangle>& triangles) {
    // Only what is in the box of a changed triangle can cross it.
    std::vector<Box> places;
    double widest = 0.0;
    for (const Blunting& change : changes)
        for (const int t : change.triangle) {
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
    std::vector<int> change_of(triangles.size(), -1);
    for (std::size_t c = 0; c < changes.size(); ++c)
        for (const int t : changes[c].triangle) change_of[t] = static_cast<int>(c);
    std::vector<char> crossing(changes.size(), 0);
    for (const auto& pair : self_intersections(near))
        for (const int t : {pair.first, pair.second})
            if (const int c = change_of[of[t]]; c >= 0) crossing[c] = 1;
    return crossing;
}

/// The sharp triangles, sharpest first: cotangent and number.
std::vector<std::pair<double, int>> sharp_triangles(const std::vector<Vec3>& points,
                                                    const std::vector<Triangle>& triangles) {
    std::vector<std::pair<double, int>> result;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const auto& [i, j, k] = triangles[t];
        if (const double s = sharpness(points[i], points[j], points[k]); s > kSharp)
            result.emplace_back(-s, static_cast<int>(t));
    }
    std::sort(result.begin(), result.end());
    for (auto& entry : result) entry.first = -entry.first;
    return result;
}

/// Takes back what crosses other triangles.
void undo_crossing(std::vector<Blunting>& changes, std::vector<Vec3>& points,
                   std::vector<Triangle>& triangles, std::vector<char>& movable) {
    while (!changes.empty()) {
        const std::vector<char> crossing = crossing_ones(changes, points, triangles);
        std::vector<Blunting> kept;
        for (std::size_t c = 0; c < changes.size(); ++c) {
            if (crossing[c])
                undo(changes[c], points, triangles, movable);
            else
                kept.push_back(std::move(changes[c]));
        }
        const bool done = kept.size() == changes.size();
        changes = std::move(kept);
        if (done) break;
    }
}

}  // namespace

double BluntedMesh::sharpness_of(const Triangle& t) const {
    return sharpness(points[t[0]], points[t[1]], points[t[2]]);
}

double BluntedMesh::facing(const std::vector<Triangle>& some) const {
    double least = 1.0;
    for (const Triangle& t : some) {
        const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
        least = std::min(least,
                         (b - a).cross(c - a).normalized().dot(probe.normal((a + b + c) / 3.0)));
    }
    return least;
}

bool BluntedMesh::may_have(const std::vector<Triangle>& candidates, double facing_before) const {
    if (!(facing(candidates) > std::min(kFacing, facing_before))) return false;
    const auto errors = triangle_errors(points, candidates, surface, kSteps, 0.5 * tolerance);
    return std::all_of(errors.begin(), errors.end(),
                       [&](const TriangleError& e) { return e.largest <= tolerance; });
}

std::vector<Blunting> blunt_sharp(std::vector<Vec3>& points, std::vector<Triangle>& triangles,
                                  std::vector<char>& movable, const Surface& surface,
                                  double tolerance) {
    std::vector<Blunting> changes;
    const auto sharp = sharp_triangles(points, triangles);
    if (sharp.empty()) return changes;
    const auto probe = surface.probe();
    BluntedMesh mesh{points,
                     triangles,
                     Corners(points.size(), triangles),
                     std::vector<char>(points.size(), 0),
                     movable,
                     surface,
                     tolerance,
                     *probe};
    for (const auto& [sharpness, t] : sharp) {
        auto change = flip(mesh, t, sharpness);
        if (!change) change = nudge(mesh, t);
        if (change) changes.push_back(std::move(*change));
    }
    undo_crossing(changes, points, triangles, movable);
    return changes;
}

void undo(const Blunting& change, std::vector<Vec3>& points, std::vector<Triangle>& triangles,
          std::vector<char>& movable) {
    for (std::size_t i = 0; i < change.triangle.size(); ++i) triangles[change.triangle[i]] = change.before[i];
    if (change.vertex < 0) return;
    points[change.vertex] = change.from;
    movable[change.vertex] = 0;
}

}  // namespace isotrack
