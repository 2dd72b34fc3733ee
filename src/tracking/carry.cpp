#include "tracking/carry.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "parallel_for_each.h"
#include "surface/thread_probes.h"
#include "tracking/registration.h"

namespace isotrack {
namespace {

constexpr std::size_t kVoters = 2000;
constexpr double kClearly = 0.8;  // times the distance of the best guess before
// Resolutions off the surface: where a field is believed, where somebody rests unless found to move by so
// much.
constexpr double kArrived = 0.25, kRests = 1e-3, kStill = 0.05;

/// The median distance from the surface of so many places.
double median_off(const std::vector<Vec3>& places, const Surface& surface) {
    const auto probe = surface.probe();
    std::vector<double> distances;
    for (std::size_t i = 0; i < places.size(); i += 1 + places.size() / kVoters)
        distances.push_back(std::abs(probe->value(places[i])));
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    return *middle;
}

/// Of one particle at least.
std::vector<Vec3> expected_positions(const Particles& particles, const Adjacency& ring,
                                     const Surface& surface, const Crossings& crossings,
                                     const Tracker::Motion& motion) {
    const std::size_t n = particles.size();
    std::vector<Vec3> winner;
    double least = std::numeric_limits<double>::infinity();
    const auto take = [&](std::vector<Vec3> guess, double better) {
        const double off = median_off(guess, surface);
        if (!winner.empty() && !(off < better * least)) return false;
        least = off;
        winner = std::move(guess);
        return true;
    };
    if (motion) {
        std::vector<Vec3> guess(n);
        parallel_for_each(n, 256, [&](std::size_t i) {
            guess[i] = motion(particles.position[i]);
            if (!guess[i].allFinite()) guess[i] = particles.position[i];
        });
        take(std::move(guess), 1.0);
    }
    std::vector<Vec3> guess(n);
    for (std::size_t i = 0; i < n; ++i) guess[i] = particles.position[i] + particles.velocity[i];
    const bool goes_on = take(std::move(guess), kClearly), stands = take(particles.position, kClearly);
    const auto registered = register_to(surface, crossings, particles, ring, winner);
    if (!registered) return winner;
    // A field knows better where it knows anything: it may be given in a band alone. What rests elsewhere
    // than a motion that was found says may only be its rounding.
    ThreadProbes probes(surface);
    const bool told = !goes_on && !stands;
    parallel_for_each(n, 256, [&](std::size_t i) {
        const auto is_on = [&](const Vec3& p, double within) {
            return std::abs(probes.local().value(p)) < within * surface.resolution();
        };
        const Vec3 &old = particles.position[i], &found = (*registered)[i];
        if (told ? is_on(winner[i], kArrived)
                 : is_on(old, kRests) && (found - old).norm() < kStill * surface.resolution())
            winner[i] = told ? winner[i] : old;
        else
            winner[i] = found;
    });
    return winner;
}

}  // namespace

std::vector<char> carry(Particles& particles, const Adjacency& ring, const Surface& surface,
                        const Crossings& crossings, const Tracker::Motion& motion) {
    const std::size_t n = particles.size();
    std::vector<char> keep(n, 0);
    if (n == 0) return keep;
    const std::vector<Vec3> expected = expected_positions(particles, ring, surface, crossings, motion);
    ThreadProbes probes(surface);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 128), [&](const auto& range) {
        Surface::Probe& probe = probes.local();
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const Vec3 old = particles.position[i];
            for (const Vec3& start : {expected[i], old}) {
                const auto p = probe.project(start);
                if (!p) continue;
                const Vec3 n_new = probe.normal(*p);
                if (!(n_new.dot(particles.normal[i]) > 0.0)) continue;
                particles.position[i] = *p;
                particles.normal[i] = n_new;
                particles.velocity[i] = *p - old;
                keep[i] = 1;
                break;
            }
        }
    });
    return keep;
}

}  // namespace isotrack
