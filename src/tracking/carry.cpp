#include "tracking/carry.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr std::size_t kVoters = 2000;
constexpr double kClearly = 0.8;

std::vector<Vec3> expected_positions(const Particles& particles, const Surface& surface,
                                     const Tracker::Motion& motion) {
    const std::size_t n = particles.size(), step = 1 + n / kVoters;
    std::vector<std::vector<Vec3>> guesses;
    if (motion) {
        guesses.emplace_back(n);
        tbb::parallel_for(std::size_t{0}, n,
                          [&](std::size_t i) { guesses.back()[i] = motion(particles.position[i]); });
    }
    guesses.emplace_back(n);
    for (std::size_t i = 0; i < n; ++i) guesses.back()[i] = particles.position[i] + particles.velocity[i];
    guesses.push_back(particles.position);
    const auto probe = surface.probe();
    std::size_t winner = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t g = 0; g < guesses.size(); ++g) {
        std::vector<double> distances;
        for (std::size_t i = 0; i < n; i += step) distances.push_back(std::abs(probe->value(guesses[g][i])));
        if (distances.empty()) break;
        const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
        std::nth_element(distances.begin(), middle, distances.end());
        if (*middle < kClearly * least) {
            least = *middle;
            winner = g;
        }
    }
    return std::move(guesses[winner]);
}

}  // namespace

std::vector<char> carry(Particles& particles, const Surface& surface, const Tracker::Motion& motion) {
    const std::size_t n = particles.size();
    std::vector<char> keep(n, 0);
    const std::vector<Vec3> expected = expected_positions(particles, surface, motion);
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
