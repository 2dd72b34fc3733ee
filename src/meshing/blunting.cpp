#include "meshing/blunting.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "find_in_blocks.h"
#include "meshing/crossing_triangles.h"
#include "meshing/sharpness.h"
#include "parallel_for_each.h"
#include "sampling/compact.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr double kShort = 0.5;  // details: longest edge of what is moved only where there is little of it
constexpr long kShortOnes = 500;
constexpr std::size_t kTrianglesPerShortOne = 100;

using Sharp = std::pair<double, int>;  // minus the sharpness of a triangle, and which it is

/// A sharp triangle, and what may be done about it.
struct Look {
    int triangle;
    double sharpness;
    bool is_short, may_move;
    std::optional<Proposal> found;
};

/// Hands out triangles in their order, but later ones at once with earlier ones, as long as what is done
/// about one is of no matter to another.
class Independent {
public:
    Independent(std::vector<Sharp> sharp, const BluntedMesh& mesh)
        : sharp_(std::move(sharp)), mesh_(mesh), claimed_(mesh.points.size(), 0) {}

    /// Empty when all were taken.
    std::vector<Sharp> take() {
        ++round_;
        std::vector<Sharp> taken, passed_over;
        const auto consider = [&](const Sharp& one) {
            (is_claimed(one.second) ? passed_over : taken).push_back(one);
            claim(one.second);
        };
        for (const Sharp& one : waiting_) consider(one);
        for (; next_ < sharp_.size() && taken.size() < kMostAtOnce && passed_over.size() < kMostWaiting;
             ++next_)
            consider(sharp_[next_]);
        waiting_ = std::move(passed_over);
        return taken;
    }

private:
    static constexpr std::size_t kMostAtOnce = 64, kMostWaiting = 256;

    /// Calls `visit` with the vertices of the triangles around a triangle's corners, among them all that may
    /// be touched for it, until that returns true; returns whether.
    template <typename Visit>
    bool any_around(int triangle, const Visit& visit) const {
        const Corners& corners = mesh_.corners;
        for (const int v : mesh_.triangles[triangle])
            for (int e = corners.first[v]; e < corners.first[v + 1]; ++e)
                for (const int w : mesh_.triangles[corners.corner[e] / 3])
                    if (visit(w)) return true;
        return false;
    }
    /// Where these of two triangles have none in common no triangle around what moves for one has a vertex
    /// in common with what moves for the other.
    bool is_claimed(int triangle) const {
        return any_around(triangle, [&](int v) { return claimed_[v] == round_; });
    }
    void claim(int triangle) {
        any_around(triangle, [&](int v) {
            claimed_[v] = round_;
            return false;
        });
    }

    const std::vector<Sharp> sharp_;
    const BluntedMesh& mesh_;
    std::vector<Sharp> waiting_;  // passed over, before those from next_ on
    std::size_t next_ = 0;
    std::vector<int> claimed_;  // in which round
    int round_ = 0;
};

}  // namespace

double BluntedMesh::sharpness_of(const Triangle& t) const {
    return sharpness(points[t[0]], points[t[1]], points[t[2]]);
}

double BluntedMesh::longest_edge_of(int triangle) const {
    const auto [a, b, c] = places_of(triangles[triangle]);
    return std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
}

Replaced BluntedMesh::replaced(const std::vector<int>& numbers, Surface::Probe& probe) const {
    std::vector<int> beside;
    for (const int number : numbers)
        for (const int v : triangles[number])
            for (int e = corners.first[v]; e < corners.first[v + 1]; ++e)
                beside.push_back(corners.corner[e] / 3);
    return ReplaceableMesh::replaced(numbers, std::move(beside), probe);
}

std::vector<Triangle> BluntedMesh::near(const Box& box, const std::vector<int>& except) const {
    std::vector<Triangle> result;
    for (const int t : boxes().meeting(box))
        if (!std::binary_search(except.begin(), except.end(), t)) result.push_back(triangles[t]);
    return result;
}

namespace {

void take_back(const Blunting& change, std::vector<Vec3>& points, std::vector<Triangle>& triangles) {
    for (std::size_t i = 0; i < change.triangle.size(); ++i) triangles[change.triangle[i]] = change.before[i];
    if (change.vertex >= 0) points[change.vertex] = change.from;
}

}  // namespace

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
    constexpr std::size_t kBlock = 4096;
    auto sharp = find_in_blocks<Sharp>(
        triangles_.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<Sharp>& found) {
            for (std::size_t t = begin; t < end; ++t) {
                const auto& [i, j, k] = triangles_[t];
                if (!open_[i] && !open_[j] && !open_[k]) continue;
                if (const double s = sharpness(points_[i], points_[j], points_[k]); s > kSharpnessAt30Degrees)
                    found.emplace_back(-s, static_cast<int>(t));
            }
        });
    open_.assign(points_.size(), 0);
    if (sharp.empty()) return false;
    std::sort(sharp.begin(), sharp.end());
    BluntedMesh mesh{{points_, triangles_, tolerance_, detail_, reached_},
                     Corners(points_.size(), triangles_),
                     movable_,
                     fixed_,
                     lost_,
                     [this]() -> const TriangleBoxes& {
                         std::call_once(made_boxes_, [this] {
                             boxes_ = std::make_unique<TriangleBoxes>(points_, triangles_);
                         });
                         return *boxes_;
                     },
                     std::vector<char>(points_.size(), 0)};
    const std::size_t before = changes_.size();
    ThreadProbes probes(surface_);
    const auto look_at = [&](Look& look) {
        Surface::Probe& probe = probes.local();
        const int t = look.triangle;
        look.found = flip(mesh, t, look.sharpness, probe);
        if (look.found || !look.may_move) return;
        look.found = nudge(mesh, t, probe);
        if (look.found || !(look.sharpness > kSharpnessAt18Degrees) || searched_[t]) return;
        look.found = search(mesh, t, probe);
        const Triangle& corners = triangles_[t];
        const bool is_free =
            std::none_of(corners.begin(), corners.end(), [&](int v) { return mesh.touched[v] != 0; });
        searched_[t] = !look.found && is_free;
    };
    // Sharpest first, but those beside each other have to be looked at in order, others may be at once.
    Independent independent(std::move(sharp), mesh);
    for (auto some = independent.take(); !some.empty(); some = independent.take()) {
        std::vector<Look> looks;
        for (const auto& [sharpest, t] : some) {
            const bool is_short = mesh.longest_edge_of(t) < kShort * detail_;
            looks.push_back({t, -sharpest, is_short, !is_short || short_ones_left_ > 0, std::nullopt});
            if (is_short) --short_ones_left_;  // unless it is flipped
        }
        parallel_for_each(looks.size(), 1, [&](std::size_t l) { look_at(looks[l]); });
        for (Look& look : looks) {
            for (const int v : triangles_[look.triangle])
                if (mesh.touched[v]) open_[v] = 1;
            if (look.is_short && look.found && look.found->change.vertex < 0) ++short_ones_left_;
            if (look.found) make(std::move(*look.found), mesh.touched);
        }
    }
    return changes_.size() > before;
}

void Blunter::make(Proposal&& proposal, std::vector<char>& touched) {
    auto& [change, after, lost, to] = proposal;
    if (change.vertex >= 0) {
        points_[change.vertex] = to;
    } else {
        lost_.insert(lost);
        for (int i = 0; i < 2; ++i) triangles_[change.triangle[i]] = after[i];
    }
    for (const Triangle& t : change.before)
        for (const int v : t) touched[v] = open_[v] = 1;
    for (const int changed : change.triangle) {
        if (boxes_) boxes_->note(changed);
        unchecked_[changed] = 1;
        searched_[changed] = 0;
    }
    changes_.push_back(std::move(change));
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

std::pair<std::vector<Vec3>, std::vector<Triangle>> Blunter::before() const {
    std::pair result(points_, triangles_);
    for (auto change = changes_.rbegin(); change != changes_.rend(); ++change)
        take_back(*change, result.first, result.second);
    return result;
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
        take_back(change, points_, triangles_);
        for (const int t : change.triangle) {
            searched_[t] = 0;
            unchecked_[t] = 1;
        }
        for (const Triangle& t : change.before)
            for (const int v : t) open_[v] = 1;
        if (change.vertex >= 0 && marked[c]) fixed_[change.vertex] = 1;
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
