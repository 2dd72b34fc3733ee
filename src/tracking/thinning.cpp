#include "tracking/thinning.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <queue>
#include <utility>

#include "isotrack/meshing/certify.h"
#include "meshing/corners.h"
#include "meshing/sharpness.h"
#include "meshing/stands_for.h"
#include "sampling/crowded.h"
#include "sampling/metric.h"
#include "surface/thread_probes.h"

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
    at.reserve(ring.size());
    for (const int v : ring) at.emplace_back((points[v] - middle).dot(x), (points[v] - middle).dot(y));
    std::vector<Triangle> result;
    result.reserve(ring.size() - 2);
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
    static constexpr std::size_t kMostlyEnough = 8;  // triangles around a particle

public:
    Thinning(const Particles& particles, std::vector<Triangle>& triangles, const Adjacency& ring,
             const Surface& surface, const CrossingGrid& crossings, const ThinningLimits& limits)
        : particles_(particles),
          triangles_(triangles),
          ring_(ring),
          surface_(surface),
          crossings_(crossings),
          limits_(limits),
          metrics_(metrics_of(particles)),
          fan_(particles.size()),
          keep_(particles.size(), 1),
          gone_(triangles.size(), 0),
          changed_(particles.size(), 0) {}

    std::vector<char> run() {
        std::vector<Candidate> crowded;
        tbb::parallel_invoke([&] { corners_.emplace(particles_.size(), triangles_); },
                             [&] { crowded = find_crowded(particles_, metrics_, ring_, limits_.crowded); });
        // Most may not go; what nobody has gone beside is known from the start.
        ThreadProbes probes(surface_);
        std::vector<std::vector<Triangle>> at_first(crowded.size());
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, crowded.size(), 16), [&](const auto& range) {
            for (std::size_t k = range.begin(); k < range.end(); ++k)
                at_first[k] = closing_of(crowded[k].second, probes.local());
        });
        std::vector<int> number(particles_.size(), -1);
        for (std::size_t k = 0; k < crowded.size(); ++k) number[crowded[k].second] = static_cast<int>(k);
        tbb::parallel_sort(crowded.begin(), crowded.end());
        std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> again;
        for (auto next = crowded.begin(); next != crowded.end() || !again.empty();) {
            const bool is_first_time = again.empty() || (next != crowded.end() && *next < again.top());
            const auto [q, i] = is_first_time ? *next++ : again.top();
            if (!is_first_time) again.pop();
            const double now = changed_[i] ? nearest_square(i) : q;
            if (now != q) {  // a neighbour has gone
                if (is_crowded(now)) again.emplace(now, i);
                continue;
            }
            const auto closing = changed_[i] ? closing_of(i, probes.local()) : std::move(at_first[number[i]]);
            if (!closing.empty() && fits(closing, i)) take_out(i, closing);
        }
        std::vector<Triangle> rest;
        rest.reserve(triangles_.size());
        for (std::size_t t = 0; t < triangles_.size(); ++t)
            if (!gone_[t]) rest.push_back(triangles_[t]);
        triangles_ = std::move(rest);
        return std::move(keep_);
    }

private:
    using Candidate = std::pair<double, int>;  // squared distance to the nearest, particle

    bool is_crowded(double nearest_square) const {
        return nearest_square < limits_.crowded * limits_.crowded;
    }
    /// Calls `visit` with each triangle of a particle, in ascending order, until that returns true; returns
    /// whether.
    template <typename Visit>
    bool any_around(int i, const Visit& visit) const {
        if (changed_[i]) return std::any_of(fan_[i].begin(), fan_[i].end(), visit);
        for (int e = corners_->first[i]; e < corners_->first[i + 1]; ++e)
            if (visit(corners_->corner[e] / 3)) return true;
        return false;
    }
    template <typename Visit>
    void for_each_around(int i, const Visit& visit) const {
        any_around(i, [&](int t) {
            visit(t);
            return false;
        });
    }
    /// A list of them, which may be changed from now on.
    std::vector<int>& fan_of(int i) {
        if (!changed_[i]) {
            fan_[i].reserve(kMostlyEnough);
            for_each_around(i, [&](int t) { fan_[i].push_back(t); });
        }
        changed_[i] = 1;
        return fan_[i];
    }
    /// By the triangles as they are now.
    double nearest_square(int i) const {
        double least = kInfinite;
        for_each_around(i, [&](int t) {
            for (const int j : triangles_[t])
                if (j != i) least = std::min(least, square_between(particles_, metrics_, i, j));
        });
        return least;
    }

    /// The vertices around one, in order, counter-clockwise; empty where its triangles are not one fan.
    std::vector<int> ring_around(int i) const {
        std::vector<int> fan, ring;
        fan.reserve(kMostlyEnough);
        for_each_around(i, [&](int t) { fan.push_back(t); });
        ring.reserve(fan.size());
        const auto after = [&](int t, int steps) {
            const Triangle& corner = triangles_[t];
            const auto k = std::find(corner.begin(), corner.end(), i) - corner.begin();
            return corner[(k + steps) % 3];
        };
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

    /// The triangles that would close the gap of a particle; none when it has to stay.
    std::vector<Triangle> closing_of(int i, Surface::Probe& probe) const {
        const std::vector<int> ring = ring_around(i);
        if (ring.size() < 3) return {};
        const auto& at = particles_.position;
        std::vector<Triangle> closing = triangles_within(ring, at[i], at);
        double sharpest = kSharpnessAt30Degrees;
        for_each_around(i, [&](int t) { sharpest = std::max(sharpest, sharpness_of(triangles_[t])); });
        // Most fail, and by the middle of a triangle, at which not all lattices look, most of those.
        const auto is_blunt = [&](const Triangle& t) { return sharpness_of(t) <= sharpest; };
        const auto has_near_middle = [&](const Triangle& t) {
            const Vec3 middle = (at[t[0]] + at[t[1]] + at[t[2]]) / 3.0;
            return std::abs(probe.farther_value(middle)) <= limits_.error;
        };
        const auto passes = [&](const Triangle& t) {
            const TriangleError error = certified_error(at[t[0]], at[t[1]], at[t[2]], probe, limits_.detail,
                                                        limits_.error, limits_.error);
            return error.largest <= limits_.error && error.turned_deg <= kMostTurnedDeg;
        };
        const auto all = [&](const auto& which) {
            return std::all_of(closing.begin(), closing.end(), which);
        };
        if (closing.empty() || !all(is_blunt) || !all(has_near_middle) || !all(passes)) return {};
        std::vector<FacingTriangle> before, after;
        Box box(at[i]);
        for (const int v : ring) box.extend(at[v]);
        before.reserve(ring.size());
        after.reserve(closing.size());
        for_each_around(i, [&](int t) { before.push_back(facing_triangle(triangles_[t])); });
        for (const Triangle& t : closing) after.push_back(facing_triangle(t));
        if (!stand_for_same(crossings_, before, box, after, {}, limits_.reach)) closing.clear();
        return closing;
    }

    /// Whether the mesh stays one: whoever is left keeps a fan of three triangles, and no edge that comes is
    /// there already. Changes farther off than the ring of one decide.
    bool fits(const std::vector<Triangle>& closing, int gone) const {
        const auto share = [&](int v, int w) {
            return any_around(v, [&](int t) {
                const Triangle& corner = triangles_[t];
                return std::find(corner.begin(), corner.end(), w) != corner.end() &&
                       std::find(corner.begin(), corner.end(), gone) == corner.end();
            });
        };
        std::vector<std::pair<int, int>> edges;
        edges.reserve(3 * closing.size());
        for (const Triangle& t : closing)
            for (int k = 0; k < 3; ++k) {
                const int v = t[k], w = t[(k + 1) % 3];
                int count = 0;
                for_each_around(v, [&](int) { ++count; });
                if (count <= 3) return false;
                const std::pair<int, int> edge = std::minmax(v, w);
                if (std::find(edges.begin(), edges.end(), edge) == edges.end())
                    edges.push_back(edge);
                else if (share(v, w))  // it is between two
                    return false;
            }
        return true;
    }

    void take_out(int i, const std::vector<Triangle>& closing) {
        keep_[i] = 0;
        const std::vector<int> around = fan_of(i);
        for (const int t : around) {
            gone_[t] = 1;
            for (const int v : triangles_[t]) {
                auto& own = fan_of(v);
                own.erase(std::remove(own.begin(), own.end(), t), own.end());
            }
        }
        for (const Triangle& t : closing) {
            for (const int v : t) fan_of(v).push_back(static_cast<int>(triangles_.size()));
            triangles_.push_back(t);
            gone_.push_back(0);
        }
    }

    const Particles& particles_;
    std::vector<Triangle>& triangles_;
    const Adjacency& ring_;
    const Surface& surface_;
    const CrossingGrid& crossings_;
    const ThinningLimits limits_;
    const std::vector<Metric> metrics_;
    std::optional<Corners> corners_;     // of the start, made by `run`
    std::vector<std::vector<int>> fan_;  // the triangles of those that changed since
    std::vector<char> keep_;             // particles
    std::vector<char> gone_;             // triangles
    std::vector<char> changed_;          // particles: beside one that has gone
};

}  // namespace

std::vector<char> thin(const Particles& particles, std::vector<Triangle>& triangles, const Adjacency& ring,
                       const Surface& surface, const CrossingGrid& crossings, const ThinningLimits& limits) {
    return Thinning(particles, triangles, ring, surface, crossings, limits).run();
}

}  // namespace isotrack
