#include "meshing/blunting.h"

#include <algorithm>
#include <utility>

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

}  // namespace

double BluntedMesh::sharpness_of(const Triangle& t) const {
    return sharpness(points[t[0]], points[t[1]], points[t[2]]);
}

double BluntedMesh::facing(const std::vector<Triangle>& some) const {
    double least = 1.0;
    for (const Triangle& t : some) {
        const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
        least = std::min(least, (b - a).cross(c - a).normalized().dot(probe.normal((a + b + c) / 3.0)));
    }
    return least;
}

bool BluntedMesh::may_have(const std::vector<Triangle>& candidates, double facing_before) const {
    if (!(facing(candidates) > std::min(kFacing, facing_before))) return false;
    return std::all_of(candidates.begin(), candidates.end(), [&](const Triangle& t) {
        return triangle_error(points[t[0]], points[t[1]], points[t[2]], probe, kSteps, 0.5 * tolerance)
                   .largest <= tolerance;
    });
}

Blunter::Blunter(std::vector<Vec3>& points, std::vector<Triangle>& triangles, std::vector<char> movable,
                 const Surface& surface, double tolerance)
    : points_(points),
      triangles_(triangles),
      movable_(std::move(movable)),
      surface_(surface),
      tolerance_(tolerance),
      open_(points.size(), 1) {}

std::vector<Blunting> Blunter::pass() {
    std::vector<std::pair<double, int>> sharp;
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
        const auto& [i, j, k] = triangles_[t];
        if (!open_[i] && !open_[j] && !open_[k]) continue;
        if (const double s = sharpness(points_[i], points_[j], points_[k]); s > kSharp)
            sharp.emplace_back(-s, static_cast<int>(t));
    }
    open_.assign(points_.size(), 0);
    std::vector<Blunting> changes;
    if (sharp.empty()) return changes;
    std::sort(sharp.begin(), sharp.end());
    const auto probe = surface_.probe();
    BluntedMesh mesh{points_,    triangles_, Corners(points_.size(), triangles_), movable_,
                     tolerance_, *probe,     std::vector<char>(points_.size(), 0)};
    for (const auto& [sharpest, t] : sharp) {
        for (const int v : triangles_[t])
            if (mesh.touched[v]) open_[v] = 1;
        auto change = flip(mesh, t, -sharpest);
        if (!change) change = nudge(mesh, t);
        if (!change) continue;
        changes.push_back(std::move(*change));
        reopen(changes.back());
    }
    undo_crossing(changes);
    return changes;
}

void Blunter::undo(const Blunting& change) {
    for (std::size_t i = 0; i < change.triangle.size(); ++i)
        triangles_[change.triangle[i]] = change.before[i];
    reopen(change);
    if (change.vertex < 0) return;
    points_[change.vertex] = change.from;
    movable_[change.vertex] = 0;
}

void Blunter::reopen(const Blunting& change) {
    for (const int t : change.triangle)
        for (const int v : triangles_[t]) open_[v] = 1;
}

void Blunter::undo_crossing(std::vector<Blunting>& changes) {
    while (!changes.empty()) {
        const std::vector<char> crossing = crossing_ones(changes, points_, triangles_);
        std::vector<Blunting> kept;
        for (std::size_t c = 0; c < changes.size(); ++c) {
            if (crossing[c])
                undo(changes[c]);
            else
                kept.push_back(std::move(changes[c]));
        }
        const bool done = kept.size() == changes.size();
        changes = std::move(kept);
        if (done) break;
    }
}

}  // namespace isotrack
