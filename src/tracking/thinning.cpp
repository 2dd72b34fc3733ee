#include "tracking/thinning.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <queue>
#include <tuple>

#include "isotrack/meshing/certify.h"
#include "meshing/sharpness.h"
#include "meshing/stands_for.h"
#include "sampling/metric.h"

namespace isotrack {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double kInfinite = std::numeric_limits<double>::infinity();

double cross(const Vec2& a, const Vec2& b) {
    return a.x() * b.y() - a.y() * b.x();
}

/// Whether d is inside the circle through a, b and c, which are counter-clockwise.
bool is_in_circle(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
    const Vec2 u = a - d, v = b - d, w = c - d;
    return u.squaredNorm() * cross(v, w) + v.squaredNorm() * cross(w, u) + w.squaredNorm() * cross(u, v) >
           0.0;
}

/// The Delaunay triangles of a ring around `middle`, seen along its mean normal; empty where ears cannot be
/// cut off one by one.
std::vector<Triangle> triangles_within(std::vector<int> ring, const Vec3& middle,
                                       const std::vector<Vec3>& points) {
    Vec3 normal = Vec3::Zero();
    for (std::size_t k = 0; k < ring.size(); ++k)
        normal += (points[ring[k]] - middle).cross(points[ring[(k + 1) % ring.size()]] - middle);
    if (!(normal.squaredNorm() > 0.0)) return {};
    const Vec3 n = normal.normalized(), x = n.unitOrthogonal(), y = n.cross(x);
    std::vector<Vec2> at;
    for (const int v : ring) at.emplace_back((points[v] - middle).dot(x), (points[v] - middle).dot(y));
    std::vector<Triangle> result;
    while (ring.size() >= 3) {
        const std::size_t size = ring.size();
        const auto is_ear = [&](std::size_t k) {  // whose circle is empty
            const Vec2 &a = at[(k + size - 1) % size], &b = at[k], &c = at[(k + 1) % size];
            if (!(cross(b - a, c - b) > 0.0)) return false;
            for (std::size_t other = 2; other + 1 < size; ++other)
                if (is_in_circle(a, b, c, at[(k + other) % size])) return false;
            return true;
        };
        std::size_t ear = 0;
        while (ear < size && !is_ear(ear)) ++ear;
        if (ear == size) return {};
        result.push_back({ring[(ear + size - 1) % size], ring[ear], ring[(ear + 1) % size]});
        if (size == 3) break;
        ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(ear));
        at.erase(at.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    return result;
}

class Thinning {
public:
    Thinning(const Particles& particles, std::vector<Triangle>& triangles, const Surface& surface,
             const CrossingGrid& crossings, const ThinningLimits& limits)
        : particles_(particles),
          triangles_(triangles),
          probe_(surface.probe()),
          crossings_(crossings),
          limits_(limits),
          around_(particles.size()),
          keep_(particles.size(), 1) {
        for (std::size_t t = 0; t < triangles.size(); ++t)
            for (const int v : triangles[t]) around_[v].push_back(static_cast<int>(t));
    }

    std::vector<char> run() {
        using Candidate = std::pair<double, int>;  // squared distance to the nearest, particle
        std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
        const auto push = [&](int i) {
            if (const double q = nearest_square(i); q < limits_.crowded * limits_.crowded)
                queue.emplace(q, i);
        };
        for (std::size_t i = 0; i < particles_.size(); ++i) push(static_cast<int>(i));
        while (!queue.empty()) {
            const auto [q, i] = queue.top();
            queue.pop();
            if (!keep_[i]) continue;
            const double now = nearest_square(i);
            if (now != q) {  // a neighbour has gone
                if (now < limits_.crowded * limits_.crowded) queue.emplace(now, i);
                continue;
            }
            take_out(i);
        }
        std::vector<Triangle> rest;
        for (std::size_t t = 0; t < triangles_.size(); ++t)
            if (t >= gone_.size() || !gone_[t]) rest.push_back(triangles_[t]);
        triangles_ = std::move(rest);
        return std::move(keep_);
    }

private:
    double nearest_square(int i) const {
        const Metric own = metric_of(particles_, static_cast<std::size_t>(i));
        double least = kInfinite;
        for (const int t : around_[i])
            for (const int j : triangles_[t]) {
                if (j == i || !(particles_.normal[i].dot(particles_.normal[j]) > 0.0)) continue;
                const Vec3 r = particles_.position[j] - particles_.position[i];
                least = std::min(least, 0.5 * (own.square(r) +
                                               metric_of(particles_, static_cast<std::size_t>(j)).square(r)));
            }
        return least;
    }

    /// The vertices around one, in order, counter-clockwise; empty where its triangles are not one fan.
    std::vector<int> ring_around(int i) const {
        const std::vector<int>& fan = around_[i];
        const auto after = [&](int t, int steps) {
            const Triangle& corner = triangles_[t];
            const auto k = std::find(corner.begin(), corner.end(), i) - corner.begin();
            return corner[(k + steps) % 3];
        };
        std::vector<int> ring;
        if (fan.empty()) return ring;
        int next = after(fan[0], 1);
        do {
            const auto t = std::find_if(fan.begin(), fan.end(), [&](int f) { return after(f, 1) == next; });
            if (t == fan.end() || ring.size() == fan.size()) return {};
            ring.push_back(next);
            next = after(*t, 2);
        } while (next != ring.front());
        if (ring.size() != fan.size()) ring.clear();
        return ring;
    }

    double sharpness_of(const Triangle& t) const {
        const auto& at = particles_.position;
        return sharpness(at[t[0]], at[t[1]], at[t[2]]);
    }

    FacingTriangle facing_triangle(const Triangle& t) const {
        const auto& at = particles_.position;
        return {at[t[0]], at[t[1]], at[t[2]]};
    }

    void take_out(int i) {
        const std::vector<int> ring = ring_around(i);
        if (ring.size() < 3) return;
        const auto& at = particles_.position;
        const std::vector<Triangle> closing = triangles_within(ring, at[i], at);
        if (closing.empty()) return;
        double sharpest = kSharpnessAt30Degrees;
        for (const int t : around_[i]) sharpest = std::max(sharpest, sharpness_of(triangles_[t]));
        const auto passes = [&](const Triangle& t) {
            if (!(sharpness_of(t) <= sharpest)) return false;
            for (const int v : t)  // two triangles back to back
                if (around_[v].size() <= 3) return false;
            const TriangleError error =
                certified_error(at[t[0]], at[t[1]], at[t[2]], *probe_, limits_.detail, limits_.error);
            return error.largest <= limits_.error && error.turned_deg <= kMostTurnedDeg;
        };
        if (!std::all_of(closing.begin(), closing.end(), passes)) return;
        std::vector<FacingTriangle> before, after;
        Box box(at[i]);
        for (const int v : ring) box.extend(at[v]);
        for (const int t : around_[i]) before.push_back(facing_triangle(triangles_[t]));
        for (const Triangle& t : closing) after.push_back(facing_triangle(t));
        if (!stand_for_same(crossings_, before, box, after, {}, limits_.reach)) return;
        keep_[i] = 0;
        gone_.resize(triangles_.size(), 0);
        for (const int t : around_[i]) gone_[t] = 1;
        for (const int v : ring) {
            auto& own = around_[v];
            own.erase(std::remove_if(own.begin(), own.end(), [&](int t) { return gone_[t] != 0; }),
                      own.end());
        }
        around_[i].clear();
        for (const Triangle& t : closing) {
            for (const int v : t) around_[v].push_back(static_cast<int>(triangles_.size()));
            triangles_.push_back(t);
        }
        gone_.resize(triangles_.size(), 0);
    }

    const Particles& particles_;
    std::vector<Triangle>& triangles_;
    std::unique_ptr<Surface::Probe> probe_;
    const CrossingGrid& crossings_;
    const ThinningLimits limits_;
    std::vector<std::vector<int>> around_;  // triangles of each particle
    std::vector<char> keep_, gone_;         // particles, triangles
};

}  // namespace

std::vector<char> thin(const Particles& particles, std::vector<Triangle>& triangles, const Surface& surface,
                       const CrossingGrid& crossings, const ThinningLimits& limits) {
    return Thinning(particles, triangles, surface, crossings, limits).run();
}

}  // namespace isotrack
