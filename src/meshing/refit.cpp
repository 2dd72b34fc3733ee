#include "isotrack/meshing/refit.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/fit.h"
#include "meshing/corners.h"
#include "meshing/sharpness.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr int kRounds = 2;
constexpr int kFitSteps = 3;
// Vertices slide more freely than in a fit of what is meshed again: on to the crease, if it takes some steps.
constexpr double kDamping = 0.001;
constexpr int kLattice = 3;      // of the samples in a triangle
constexpr double kGain = 0.9;    // of the error, at most, for a flip to be worth it
constexpr double kWorth = 0.25;  // of the mean error of two triangles: less is not looked at

struct Flip {
    double gain = 0.0;
    std::array<int, 2> triangle{};
    std::array<Triangle, 2> after{};
};

class ErrorFlips {
public:
    ErrorFlips(const std::vector<Vec3>& points, std::vector<Triangle>& triangles, const Surface& surface,
               double tolerance)
        : points_(points),
          triangles_(triangles),
          at_start_(triangles),
          corners_at_start_(points.size(), triangles),
          probes_(surface),
          tolerance_(tolerance) {}

    /// Flips what gains most first, and nothing next to it. Returns the triangles.
    std::vector<std::array<int, 2>> pass(const std::vector<char>& movable) {
        const Corners corners(points_.size(), triangles_);
        std::vector<char> concerned;
        for (const auto& [i, j, k] : triangles_) concerned.push_back(movable[i] || movable[j] || movable[k]);
        std::vector<double> error(triangles_.size(), 0.0);
        for_each_triangle([&](std::size_t t) {
            if (concerned[t]) error[t] = error_of(triangles_[t], probes_.local()).first;
        });
        const auto count = std::count_if(error.begin(), error.end(), [](double e) { return e > 0.0; });
        const double worth = 2.0 * kWorth * std::accumulate(error.begin(), error.end(), 0.0) /
                             static_cast<double>(std::max<std::ptrdiff_t>(1, count));
        std::vector<std::array<Flip, 3>> of_triangle(triangles_.size());
        for_each_triangle([&](std::size_t t) {
            if (!concerned[t]) return;
            for (int k = 0; k < 3; ++k)
                of_triangle[t][k] = flip_of(static_cast<int>(t), k, corners, concerned, error, worth);
        });
        std::vector<Flip> flips;
        for (const auto& some : of_triangle)
            for (const Flip& flip : some)
                if (flip.gain > 0.0) flips.push_back(flip);
        std::stable_sort(flips.begin(), flips.end(),
                         [](const Flip& a, const Flip& b) { return a.gain > b.gain; });
        std::vector<char> touched(points_.size(), 0);
        std::vector<std::array<int, 2>> done;
        for (const Flip& flip : flips) {
            const auto is_touched = [&](const Triangle& t) {
                return std::any_of(t.begin(), t.end(), [&](int v) { return touched[v]; });
            };
            if (is_touched(flip.after[0]) || is_touched(flip.after[1])) continue;
            for (int i = 0; i < 2; ++i) {
                triangles_[flip.triangle[i]] = flip.after[i];
                for (const int v : flip.after[i]) touched[v] = 1;
            }
            done.push_back(flip.triangle);
        }
        return done;
    }

private:
    template <typename Body>
    void for_each_triangle(const Body& body) const {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles_.size(), 64), [&](const auto& range) {
            for (std::size_t t = range.begin(); t < range.end(); ++t) body(t);
        });
    }

    /// Twice the area times the mean square, and the largest.
    std::pair<double, double> error_of(const Triangle& t, Surface::Probe& probe) const {
        const Vec3 &a = points_[t[0]], &b = points_[t[1]], &c = points_[t[2]];
        const TriangleError error = triangle_error(a, b, c, probe, kLattice, 0.5 * tolerance_);
        return {(b - a).cross(c - a).norm() * error.mean_square, error.largest};
    }
    double sharpness_of(const Triangle& t) const {
        return sharpness(points_[t[0]], points_[t[1]], points_[t[2]]);
    }
    double facing(const Triangle& t, Surface::Probe& probe) const {
        return isotrack::facing(points_[t[0]], points_[t[1]], points_[t[2]], probe);
    }
    bool is_edge(int v, int w, const Corners& corners) const {
        const auto has = [&](const std::vector<Triangle>& triangles, const Corners& of) {
            return of.beyond(v, w, triangles).second >= 0 || of.beyond(w, v, triangles).second >= 0;
        };
        return has(triangles_, corners) || has(at_start_, corners_at_start_);
    }

    /// The other diagonal for the edge opposite to corner k, from the side of its lower vertex; without gain
    /// where it may not be.
    Flip flip_of(int t, int k, const Corners& corners, const std::vector<char>& concerned,
                 const std::vector<double>& error, double worth) {
        const Triangle& old = triangles_[t];
        const int a = old[k], b = old[(k + 1) % 3], c = old[(k + 2) % 3];
        if (b > c) return {};
        const auto [d, other] = corners.beyond(c, b, triangles_);
        if (d < 0 || d == a || !concerned[other] || error[t] + error[other] < worth) return {};
        const std::array<Triangle, 2> after = {{{a, b, d}, {a, d, c}}};
        const double blunt_enough =
            std::max({kSharpnessAt30Degrees, sharpness_of(old), sharpness_of(triangles_[other])});
        if (!(std::max(sharpness_of(after[0]), sharpness_of(after[1])) <= blunt_enough)) return {};
        if (is_edge(a, d, corners)) return {};
        Surface::Probe& probe = probes_.local();
        const double before = error[t] + error[other];
        const auto [first, first_largest] = error_of(after[0], probe);
        if (!(first < kGain * before)) return {};
        const auto [second, second_largest] = error_of(after[1], probe);
        if (!(first + second < kGain * before) || std::max(first_largest, second_largest) > tolerance_)
            return {};
        const double facing_before = std::min(facing(old, probe), facing(triangles_[other], probe));
        if (!(std::min(facing(after[0], probe), facing(after[1], probe)) > std::min(kFacing, facing_before)))
            return {};
        return {before - first - second, {t, other}, after};
    }

    const std::vector<Vec3>& points_;
    std::vector<Triangle>& triangles_;
    const std::vector<Triangle> at_start_;
    const Corners corners_at_start_;
    ThreadProbes probes_;
    const double tolerance_;
};

}  // namespace

std::vector<std::array<int, 2>> refit(std::vector<Vec3>& vertices, std::vector<Triangle>& triangles,
                                      const Surface& surface, double tolerance,
                                      const std::vector<char>& movable) {
    ErrorFlips flips(vertices, triangles, surface, tolerance);
    std::vector<std::array<int, 2>> done;
    for (int round = 0; round < kRounds; ++round) {
        const auto some = flips.pass(movable);
        done.insert(done.end(), some.begin(), some.end());
        fit(vertices, triangles, surface, kFitSteps, movable, kDamping);
    }
    return done;
}

}  // namespace isotrack
