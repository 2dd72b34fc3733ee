#include "meshing/blunting.h"

#include <algorithm>
#include <utility>

#include "isotrack/meshing/certify.h"
#include "meshing/crossing_triangles.h"
#include "meshing/sharpness.h"
#include "meshing/stands_for.h"
#include "meshing/triangle_box.h"
#include "sampling/compact.h"

namespace isotrack {
namespace {

constexpr long kShortOnes = 500;
constexpr std::size_t kTrianglesPerShortOne = 100;

}  // namespace
double BluntedMesh::sharpness_of(const Triangle& t) const {
    return sharpness(points[t[0]], points[t[1]], points[t[2]]);
}

double BluntedMesh::facing(const std::vector<Triangle>& some) const {
    double least = 1.0;
    for (const Triangle& t : some)
        least = std::min(least, isotrack::facing(points[t[0]], points[t[1]], points[t[2]], probe));
    return least;
}

Replaced BluntedMesh::replaced(std::vector<int> numbers) const {
    Replaced result;
    std::vector<Triangle> old;
    for (const int number : numbers) {
        const Triangle& t = triangles[number];
        old.push_back(t);
        result.triangles.emplace_back(points[t[0]], points[t[1]], points[t[2]]);
        result.box.extend(box_of(points, t));
    }
    result.facing = facing(old);
    std::sort(numbers.begin(), numbers.end());
    std::vector<int> beside;
    for (const Triangle& t : old)
        for (const int v : t)
            for (int e = corners.first[v]; e < corners.first[v + 1]; ++e)
                beside.push_back(corners.corner[e] / 3);
    std::sort(beside.begin(), beside.end());
    beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
    for (const int number : beside) {
        if (std::binary_search(numbers.begin(), numbers.end(), number)) continue;
        const Triangle& t = triangles[number];
        result.beside.emplace_back(points[t[0]], points[t[1]], points[t[2]]);
    }
    return result;
}

bool BluntedMesh::reach_what(const Replaced& before, const std::vector<Triangle>& candidates) {
    std::vector<FacingTriangle> after;
    for (const Triangle& t : candidates) after.emplace_back(points[t[0]], points[t[1]], points[t[2]]);
    return std::all_of(reached.begin(), reached.end(), [&](const CrossingGrid* points_there) {
        return stand_for_same(*points_there, before.triangles, before.box, after, before.beside, tolerance);
    });
}

bool BluntedMesh::may_have(const std::vector<Triangle>& candidates, const Replaced& before) {
    if (!(facing(candidates) > std::min(kFacing, before.facing))) return false;
    const auto passes = [&](const Triangle& t) {
        const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
        const TriangleError error = certified_error(a, b, c, probe, detail, 0.5 * tolerance);
        return error.largest <= tolerance && error.turned_deg <= kMostTurnedDeg;
    };
    return std::all_of(candidates.begin(), candidates.end(), passes) && reach_what(before, candidates);
}

std::vector<Triangle> BluntedMesh::near(const Box& box, const std::vector<int>& except) {
    if (!boxes) boxes = std::make_unique<TriangleBoxes>(points, triangles);
    std::vector<Triangle> result;
    for (const int t : boxes->meeting(box))
        if (!std::binary_search(except.begin(), except.end(), t)) result.push_back(triangles[t]);
    return result;
}

Blunter::Blunter(std::vector<Vec3>& points, std::vector<Triangle>& triangles, std::vector<char> movable,
                 const Surface& surface, const std::vector<const CrossingGrid*>& reached, double tolerance,
                 std::optional<double> detail)
    : points_(points),
      triangles_(triangles),
      movable_(std::move(movable)),
      fixed_(points.size(), 0),
      surface_(surface),
      reached_(reached),
      tolerance_(tolerance),
      detail_(detail.value_or(surface.resolution())),
      open_(points.size(), 1),
      unchecked_(triangles.size(), 0),
      searched_(triangles.size(), 0),
      short_ones_left_(kShortOnes + static_cast<long>(triangles.size() / kTrianglesPerShortOne)) {}
Blunter::~Blunter() = default;

bool Blunter::run(int passes) {
    constexpr int kBetweenChecks = 4;  // for crossings: what crosses is taken back, and something else tried
    bool any = false;
    for (int p = 1; p <= passes; ++p) {
        const bool changed = pass();
        any = any || changed;
        if (changed && p < passes && p % kBetweenChecks != 0) continue;
        if (!undo_crossing() && !changed) break;
    }
    return any;
}

bool Blunter::pass() {
    std::vector<std::pair<double, int>> sharp;
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
        const auto& [i, j, k] = triangles_[t];
        if (!open_[i] && !open_[j] && !open_[k]) continue;
        if (const double s = sharpness(points_[i], points_[j], points_[k]); s > kSharpnessAt30Degrees)
            sharp.emplace_back(-s, static_cast<int>(t));
    }
    open_.assign(points_.size(), 0);
    if (sharp.empty()) return false;
    std::sort(sharp.begin(), sharp.end());
    const std::size_t before = changes_.size();
    const auto probe = surface_.probe();
    BluntedMesh mesh{points_,
                     triangles_,
                     Corners(points_.size(), triangles_),
                     movable_,
                     fixed_,
                     tolerance_,
                     detail_,
                     *probe,
                     reached_,
                     lost_,
                     searched_,
                     short_ones_left_,
                     std::vector<char>(points_.size(), 0),
                     boxes_};
    for (const auto& [sharpest, t] : sharp) {
        for (const int v : triangles_[t])
            if (mesh.touched[v]) open_[v] = 1;
        auto change = flip(mesh, t, -sharpest);
        if (!change) change = nudge(mesh, t, -sharpest);
        if (!change) continue;
        for (const int changed : change->triangle) {
            if (boxes_) boxes_->note(changed);
            unchecked_[changed] = 1;
            searched_[changed] = 0;
            for (const int v : triangles_[changed]) open_[v] = 1;
        }
        changes_.push_back(std::move(*change));
    }
    return changes_.size() > before;
}

bool Blunter::undo_near(const std::vector<Vec3>& places, double distance) {
    if (changes_.empty()) return false;
    std::vector<char> marked(changes_.size(), 0);
    for (std::size_t c = 0; c < changes_.size(); ++c) {
        Box box;
        for (const int t : changes_[c].triangle)
            for (const int v : triangles_[t]) box.extend(points_[v]);
        marked[c] = std::any_of(places.begin(), places.end(),
                                [&](const Vec3& p) { return box.exteriorDistance(p) <= distance; });
    }
    if (std::find(marked.begin(), marked.end(), 1) == marked.end()) marked.assign(changes_.size(), 1);
    undo(marked);
    undo_crossing();
    return true;
}

/// Takes back those that are marked, and later ones that concern the same triangles.
void Blunter::undo(const std::vector<char>& marked) {
    std::vector<char> back(triangles_.size(), 0), taken = marked;
    for (std::size_t c = 0; c < changes_.size(); ++c) {
        const auto& concerned = changes_[c].triangle;
        taken[c] =
            taken[c] || std::any_of(concerned.begin(), concerned.end(), [&](int t) { return back[t]; });
        if (taken[c])
            for (const int t : concerned) back[t] = 1;
    }
    for (std::size_t c = changes_.size(); c-- > 0;) {
        if (!taken[c]) continue;
        const Blunting& change = changes_[c];
        for (std::size_t i = 0; i < change.triangle.size(); ++i) {
            triangles_[change.triangle[i]] = change.before[i];
            searched_[change.triangle[i]] = 0;
            unchecked_[change.triangle[i]] = 1;
        }
        for (const Triangle& t : change.before)
            for (const int v : t) open_[v] = 1;
        if (change.vertex < 0) continue;
        points_[change.vertex] = change.from;
        if (marked[c]) fixed_[change.vertex] = 1;
    }
    for (std::size_t c = 0; boxes_ && c < changes_.size(); ++c)
        if (taken[c])
            for (const int t : changes_[c].triangle) boxes_->note(t);
    for (char& flag : taken) flag = !flag;
    compact(changes_, taken);
}

bool Blunter::undo_crossing() {
    for (bool any = false;; any = true) {
        const std::vector<char> crossing = crossing_triangles(points_, triangles_, unchecked_);
        unchecked_.assign(triangles_.size(), 0);
        std::vector<char> marked;
        for (const Blunting& change : changes_)
            marked.push_back(std::any_of(change.triangle.begin(), change.triangle.end(),
                                         [&](int t) { return crossing[t]; }));
        if (std::find(marked.begin(), marked.end(), 1) == marked.end()) return any;
        undo(marked);
    }
}

}  // namespace isotrack
