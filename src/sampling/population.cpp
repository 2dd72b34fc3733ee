#include "isotrack/sampling/population.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "find_in_blocks.h"
#include "parallel_for_each.h"
#include "sampling/crowded.h"
#include "sampling/metric.h"
#include "surface/float_precision.h"
#include "surface/surface_near.h"
#include "surface/thread_probes.h"

namespace isotrack {

constexpr int kTaken = -2;
constexpr double kPi = 3.14159265358979323846;
constexpr double kEmpty =
    0.8;  // of the spacing: nearest neighbour of a birth; its triangle may be none of the DT any more

namespace {

/// The numbers below `count` whose `measure(number)` is less than `limit`, by that, ascending.
template <typename Measure>
std::vector<std::pair<double, int>> smallest_first(std::size_t count, const Measure& measure, double limit) {
    constexpr std::size_t kBlock = 4096;
    auto result = find_in_blocks<std::pair<double, int>>(
        count, kBlock, [&](std::size_t begin, std::size_t end, std::vector<std::pair<double, int>>& found) {
            for (std::size_t i = begin; i < end; ++i)
                if (const double value = measure(i); value < limit)
                    found.emplace_back(value, static_cast<int>(i));
        });
    std::sort(result.begin(), result.end());
    return result;
}

}  // namespace

std::vector<char> uncrowded(const Particles& particles, const Adjacency& adjacency,
                            const PopulationBand& band) {
    auto crowded = find_crowded(particles, metrics_of(particles), adjacency, band.crowded);
    std::sort(crowded.begin(), crowded.end());
    std::vector<char> keep(particles.size(), 1);
    for (const auto& [q, i] : crowded) {
        bool neighbour_went = false;
        for (const int j : adjacency.of(i)) neighbour_went = neighbour_went || !keep[j];
        if (!neighbour_went) keep[i] = 0;
    }
    return keep;
}

namespace {

/// A triangle in the mean metric of its corners.
struct MetricTriangle {
    const Particles& particles;
    const Triangle& corner;
    const Metric metric[3];  // of each corner, from those of all particles
    double side2[3];         // squared, opposite each corner
    double area2_16;         // 16 times the squared area

    MetricTriangle(const Particles& of, const std::vector<Metric>& metrics, const Triangle& triangle)
        : particles(of),
          corner(triangle),
          metric{metrics[triangle[0]], metrics[triangle[1]], metrics[triangle[2]]} {
        for (int k = 0; k < 3; ++k)
            side2[k] =
                square(particles.position[corner[(k + 2) % 3]] - particles.position[corner[(k + 1) % 3]]);
        area2_16 = 2.0 * (side2[0] * side2[1] + side2[1] * side2[2] + side2[2] * side2[0]) -
                   (side2[0] * side2[0] + side2[1] * side2[1] + side2[2] * side2[2]);
    }
    double square(const Vec3& r) const {
        return (metric[0].square(r) + metric[1].square(r) + metric[2].square(r)) / 3.0;
    }
    double circumradius() const { return std::sqrt(side2[0] * side2[1] * side2[2] / area2_16); }
    Vec3 circumcentre() const {
        Vec3 centre = Vec3::Zero();
        for (int k = 0; k < 3; ++k)
            centre += side2[k] * (side2[(k + 1) % 3] + side2[(k + 2) % 3] - side2[k]) / area2_16 *
                      particles.position[corner[k]];
        return centre;
    }
    Vec3 middle() const {
        return (particles.position[corner[0]] + particles.position[corner[1]] +
                particles.position[corner[2]]) /
               3.0;
    }
};

}  // namespace

std::vector<Triangle> fill_sparse(Particles& particles, const std::vector<Triangle>& triangles,
                                  const Adjacency& ring, const Surface& surface, Id& next_id,
                                  const PopulationBand& band) {
    const std::vector<Metric> metrics = metrics_of(particles);
    const auto minus_radius = [&](std::size_t t) {
        const MetricTriangle triangle(particles, metrics, triangles[t]);
        return triangle.area2_16 > 0.0 ? -triangle.circumradius() : 0.0;
    };
    const auto large = smallest_first(triangles.size(), minus_radius, -band.sparse);
    struct Place {
        Vec3 position, normal;
    };
    /// Where a particle would be born in a triangle, if nobody is near.
    const auto place_in = [&](const Triangle& corner, Surface::Probe& probe) -> std::optional<Place> {
        const auto& [a, b, c] = corner;
        const MetricTriangle triangle(particles, metrics, corner);
        // An obtuse triangle has its circumcentre far outside: stay within one spacing.
        const Vec3 middle = triangle.middle(), to_centre = triangle.circumcentre() - middle;
        const double off = std::sqrt(triangle.square(to_centre));
        const auto p = probe.project(middle + to_centre / std::max(1.0, off));
        if (!p) return std::nullopt;
        const Vec3 n = probe.normal(*p);
        if (!(n.dot(particles.normal[a] + particles.normal[b] + particles.normal[c]) > 0.0))
            return std::nullopt;
        const auto is_near = [&](int j) {
            return n.dot(particles.normal[j]) > 0.0 &&
                   triangle.square(particles.position[j] - *p) < kEmpty * kEmpty;
        };
        const auto any_near = [&](int j) {
            const Adjacency::Range beside = ring.of(j);
            return is_near(j) || std::any_of(beside.begin(), beside.end(), is_near);
        };
        if (std::any_of(corner.begin(), corner.end(), [&](int v) {
                const Adjacency::Range beside = ring.of(v);
                return std::any_of(beside.begin(), beside.end(), any_near);
            }))
            return std::nullopt;
        return Place{*p, n};
    };
    ThreadProbes probes(surface);
    std::vector<std::optional<Place>> places(large.size());
    parallel_for_each(large.size(), 16, [&](std::size_t k) {
        places[k] = place_in(triangles[large[k].second], probes.local());
    });
    std::vector<char> touched(particles.size(), 0);
    std::vector<Triangle> parents;
    for (std::size_t k = 0; k < large.size(); ++k) {
        const Triangle& corner = triangles[large[k].second];
        const auto& [a, b, c] = corner;
        if (!places[k] || touched[a] || touched[b] || touched[c]) continue;
        const Vec3 velocity = (particles.velocity[a] + particles.velocity[b] + particles.velocity[c]) / 3.0;
        const double ha = particles.spacing[a], hb = particles.spacing[b], hc = particles.spacing[c];
        const double h =
            std::min((ha + hb + hc) / 3.0, std::max({ha, hb, hc}));  // rounding may not add to it
        particles.add(places[k]->position, places[k]->normal, h, next_id++, velocity);
        particles.stretch.back() = particles.stretch[a];
        touched[a] = touched[b] = touched[c] = 1;
        parents.push_back(corner);
    }
    return parents;
}

Densifier::Densifier(Particles& particles, const Surface& surface, double detail, double min_spacing,
                     double max_spacing, std::size_t most, Id& next_id)
    : particles_(particles),
      surface_(surface),
      detail_(detail),
      min_spacing_(min_spacing),
      max_spacing_(max_spacing),
      most_(most),
      next_id_(next_id),
      probe_(surface.probe()),
      grid_(particles.position, 2.0 * detail, particles.size() + particles.size() / 16) {}

std::size_t Densifier::add(const std::vector<Shortage>& shortages) {
    constexpr double kShrink = 0.6;
    constexpr int kAround = 6;
    constexpr double kGoldenAngle = 2.399963;
    constexpr double kNoSpacing = 1e-30;
    const std::size_t before = particles_.size();
    if (shortages.empty() || before >= most_) return 0;
    first_of_call_ = static_cast<int>(before);
    widest_of_call_ = 0.0;
    grid_.take_new();
    std::vector<char> surrounded(before, 0);
    for (const Shortage& s : shortages) {
        const double wanted = std::max(s.spacing, min_spacing_);
        const int there = add_or_nearest(s.place, wanted);
        if (there < 0 || there >= first_of_call_ || surrounded[there]) continue;
        surrounded[there] = 1;
        const Vec3 p = particles_.position[there], a = particles_.normal[there].unitOrthogonal(),
                   b = particles_.normal[there].cross(a);
        // Where there is no place for any of the ring, because those that are there are too near, as on a
        // body smaller than the ring, it becomes smaller still.
        for (bool again = true; again;) {
            const double h = kShrink * std::min(wanted, particles_.spacing[there]);
            if (!(h >= std::max({min_spacing_, s.least, kNoSpacing}))) break;
            particles_.spacing[there] = h;
            const std::size_t so_far = particles_.size();
            bool taken = false;
            const double turn = kGoldenAngle * static_cast<double>(so_far);  // rings do not line up
            for (int k = 0; k < kAround; ++k) {
                const double angle = turn + 2.0 * kPi * k / kAround;
                const int nearest = add_or_nearest(p + h * (std::cos(angle) * a + std::sin(angle) * b), h);
                taken = taken || nearest == kTaken;
            }
            again = !taken && particles_.size() == so_far;
        }
    }
    return particles_.size() - before;
}

int Densifier::add_or_nearest(const Vec3& place, double h) {
    constexpr double kApart = 0.7, kFar = 10.0;
    constexpr double kFarthest = 8.0;    // details
    constexpr double kNearEnough = 0.5;  // resolutions
    int nearest = -1;
    if (particles_.size() >= most_) return nearest;
    auto projected = probe_->project(place);
    if (!projected) projected = surface_near(*probe_, place, kNearEnough * surface_.resolution());
    if (!projected) return nearest;
    const Vec3 p = to_float_precision(*projected), n = probe_->normal(p);
    if (!(n.squaredNorm() > 0.0)) return nearest;
    const double apart = kApart * h, far = std::max(apart, std::min(kFar * h, kFarthest * detail_));
    const double crowded = kApart * widest_of_call_;
    double least = far * far;
    bool taken = false;
    for (double reach = std::max(apart, crowded); nearest < 0; reach = std::min(2.0 * reach, far)) {
        grid_.for_each_within(p, reach, [&](int i, double d2) {
            if (!(particles_.normal[i].dot(n) > 0.0)) return;
            const double own = kApart * particles_.spacing[i];
            taken = taken || (i >= first_of_call_ && d2 < own * own);
            if (d2 > least) return;
            least = d2;
            nearest = i;
        });
        if (!(reach < far)) break;
    }
    const double distance = std::sqrt(least);
    if (taken) return kTaken;
    if (nearest >= 0 && distance < std::min(apart, kApart * particles_.spacing[nearest])) return nearest;
    const double spacing = distance < apart ? distance / kApart : std::max(distance, h);
    particles_.add(p, n, std::max(std::min(spacing, max_spacing_), min_spacing_), next_id_++);
    grid_.take_new();
    widest_of_call_ = std::max(widest_of_call_, particles_.spacing.back());
    return -1;
}

}  // namespace isotrack
