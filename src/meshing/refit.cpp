#include "isotrack/meshing/refit.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "find_in_blocks.h"
#include "isotrack/meshing/certify.h"
#include "meshing/corners.h"
#include "meshing/facet_values.h"
#include "meshing/fit_steps.h"
#include "meshing/sharpness.h"
#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr int kFitSteps = 4;
// Vertices slide more freely than in a fit: on to the crease, if it takes some steps.
constexpr double kDamping = 0.001;
constexpr double kGain = 0.9;   // of the error, at most, for a flip to be worth it
constexpr double kWorth = 0.1;  // of the mean error of two triangles: less is not looked at

struct Flip {
    double gain;
    std::array<int, 2> triangle;
    std::array<Triangle, 2> after;
    std::array<FacetValues, 2> facet;  // after it
};

class ErrorFlips {
public:
    ErrorFlips(const std::vector<Vec3>& points, std::vector<Triangle>& triangles, const Surface& surface,
               double tolerance)
        : points_(points),
          triangles_(triangles),
          corners_(points.size(), triangles),
          facets_(facet_values(points, triangles, corners_, surface)),
          probes_(surface),
          tolerance_(tolerance) {}

    /// Flips what gains most first, and no triangle twice. Returns the triangles.
    std::vector<std::array<int, 2>> flip(const std::vector<char>& movable) {
        std::vector<double> error(triangles_.size(), 0.0);
        constexpr std::size_t kTrianglesPerBlock = 1024;
        parallel_for_each(triangles_.size(), kTrianglesPerBlock, [&](std::size_t t) {
            const auto& [i, j, k] = triangles_[t];
            if (movable[i] && movable[j] && movable[k]) error[t] = facets_[t].error();
        });
        const auto count = std::count_if(error.begin(), error.end(), [](double e) { return e > 0.0; });
        const double worth = 2.0 * kWorth * std::accumulate(error.begin(), error.end(), 0.0) /
                             static_cast<double>(std::max<std::ptrdiff_t>(1, count));
        const std::vector<Flip> flips =
            find_in_blocks<Flip>(triangles_.size(), kTrianglesPerBlock,
                                 [&](std::size_t begin, std::size_t end, std::vector<Flip>& found) {
                                     for (std::size_t t = begin; t < end; ++t)
                                         for (int k = 0; k < 3; ++k)
                                             if (auto flip = flip_of(static_cast<int>(t), k, error, worth))
                                                 found.push_back(*flip);
                                 });
        std::vector<const Flip*> by_gain;
        by_gain.reserve(flips.size());
        for (const Flip& flip : flips) by_gain.push_back(&flip);
        std::stable_sort(by_gain.begin(), by_gain.end(),
                         [](const Flip* a, const Flip* b) { return a->gain > b->gain; });
        std::vector<char> flipped(triangles_.size(), 0);
        std::set<std::pair<int, int>> made;  // edges: two flips may be after the same
        std::vector<std::array<int, 2>> done;
        for (const Flip* best : by_gain) {
            const auto& [t, other] = best->triangle;
            if (flipped[t] || flipped[other]) continue;
            if (!made.insert(std::minmax(best->after[0][0], best->after[0][2])).second) continue;
            for (int i = 0; i < 2; ++i) {
                flipped[best->triangle[i]] = 1;
                triangles_[best->triangle[i]] = best->after[i];
                facets_[best->triangle[i]] = best->facet[i];
            }
            done.push_back(best->triangle);
        }
        return done;
    }
    /// Of the triangles as they are now, which are given up.
    std::vector<FacetValues> take_facets() { return std::move(facets_); }

private:
    FacetValues facet_of(const Triangle& t, Surface::Probe& probe) const {
        return {points_[t[0]], points_[t[1]], points_[t[2]], probe};
    }
    double largest_error(const Triangle& t, Surface::Probe& probe) const {
        return triangle_error(points_[t[0]], points_[t[1]], points_[t[2]], probe, FacetValues::kSteps,
                              0.5 * tolerance_)
            .largest;
    }
    double sharpness_of(const Triangle& t) const {
        return sharpness(points_[t[0]], points_[t[1]], points_[t[2]]);
    }
    bool is_sharp(const Triangle& t) const {
        return is_sharper(kSharpnessAt30Degrees, points_[t[0]], points_[t[1]], points_[t[2]]);
    }
    double facing(const Triangle& t, Surface::Probe& probe) const {
        return isotrack::facing(points_[t[0]], points_[t[1]], points_[t[2]], probe);
    }
    bool is_edge(int v, int w) const {
        return corners_.beyond(v, w, triangles_).second >= 0 || corners_.beyond(w, v, triangles_).second >= 0;
    }

    /// About the least error that triangles t and `other` may have with the other diagonal, from a to d
    /// instead of from b to c; infinite where the diagonals do not cross. From old to new triangles is a
    /// pyramid, as high as the diagonals are apart where they cross. Across it the value changes with a slope
    /// that is not known: 1 where the surface faces as the triangles do, less at a crease.
    double expected_error(int t, int other, int a, int b, int c, int d) const {
        const Vec3 &pa = points_[a], &pb = points_[b], old = points_[c] - pb, now = points_[d] - pa;
        const Vec3 normal = (facets_[t].normal + facets_[other].normal).cast<double>().normalized();
        const double across = normal.dot(now.cross(old));
        const double s = normal.dot(now.cross(pa - pb)) / across, r = normal.dot(old.cross(pa - pb)) / across;
        if (!(s > 0.0 && s < 1.0 && r > 0.0 && r < 1.0)) return std::numeric_limits<double>::infinity();
        const double height = normal.dot(pa + r * now - pb - s * old);
        double values2 = 0.0, values_by_heights = 0.0, heights2 = 0.0;  // integrals
        for (const int of : {t, other}) {
            const FacetValues& facet = facets_[of];
            const auto corner = [&](int v) {
                return std::find(triangles_[of].begin(), triangles_[of].end(), v) - triangles_[of].begin();
            };
            const auto at_b = corner(b), at_c = corner(c);
            const double weight = double{facet.area2} / FacetValues::kPoints;
            for (int n = 0; n < FacetValues::kPoints; ++n) {
                const auto& place = FacetValues::kPlace[n];
                const double x = facet.value[n],
                             h = height * std::min(place[at_c] / s, place[at_b] / (1.0 - s));
                values2 += weight * x * x;
                values_by_heights += weight * x * h;
                heights2 += weight * h * h;
            }
        }
        const double slope = heights2 > 0.0 ? std::clamp(-values_by_heights / heights2, 0.0, 1.0) : 0.0;
        return values2 + slope * (2.0 * values_by_heights + slope * heights2);
    }

    /// The other diagonal for the edge opposite to corner k, from the side of its lower vertex; none where it
    /// may not be, or gains too little. `error`: of each triangle, 0 of those that stay.
    std::optional<Flip> flip_of(int t, int k, const std::vector<double>& error, double worth) {
        const Triangle& old = triangles_[t];
        const int a = old[k], b = old[(k + 1) % 3], c = old[(k + 2) % 3];
        if (b > c || !(error[t] > 0.0)) return {};
        const auto [d, other] = corners_.beyond(c, b, triangles_);
        if (d < 0 || d == a || !(error[other] > 0.0) || error[t] + error[other] < worth) return {};
        const double before = error[t] + error[other];
        const std::array<Triangle, 2> after = {{{a, b, d}, {a, d, c}}};
        if ((is_sharp(after[0]) || is_sharp(after[1])) &&
            !(std::max(sharpness_of(after[0]), sharpness_of(after[1])) <=
              std::max(sharpness_of(old), sharpness_of(triangles_[other]))))
            return {};
        if (!(expected_error(t, other, a, b, c, d) < kGain * before)) return {};
        if (is_edge(a, d)) return {};
        Surface::Probe& probe = probes_.local();
        const FacetValues first = facet_of(after[0], probe);
        if (!(first.error() < kGain * before)) return {};
        const FacetValues second = facet_of(after[1], probe);
        const double now = first.error() + second.error();
        if (!(now < kGain * before) || largest_error(after[0], probe) > tolerance_ ||
            largest_error(after[1], probe) > tolerance_)
            return {};
        const double facing_before = std::min(facing(old, probe), facing(triangles_[other], probe));
        if (!(std::min(facing(after[0], probe), facing(after[1], probe)) > std::min(kFacing, facing_before)))
            return {};
        return Flip{before - now, {t, other}, after, {first, second}};
    }

    const std::vector<Vec3>& points_;
    std::vector<Triangle>& triangles_;
    const Corners corners_;  // before any flip
    std::vector<FacetValues> facets_;
    ThreadProbes probes_;
    const double tolerance_;
};

}  // namespace

std::vector<std::array<int, 2>> refit(std::vector<Vec3>& vertices, std::vector<Triangle>& triangles,
                                      const Surface& surface, double tolerance,
                                      const std::vector<char>& movable) {
    std::vector<FacetValues> facets;
    std::vector<std::array<int, 2>> done;
    {  // which holds what is of no use to the steps
        ErrorFlips flips(vertices, triangles, surface, tolerance);
        done = flips.flip(movable);
        facets = flips.take_facets();
    }
    fit_steps(vertices, triangles, Corners(vertices.size(), triangles), std::move(facets), surface, kFitSteps,
              movable, kDamping);
    return done;
}

}  // namespace isotrack
