#include "isotrack/sampling/cover.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <utility>

#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr double kReach = 1.2;  // of the spacing: what a particle that is already there covers
constexpr double kNear = 0.75;  // of the spacing: where most of that is
constexpr double kOffPlane =
    0.5;  // of the reach: how far from a particle's tangent plane surface counts as its own
// A lattice edge along the surface, up to this cosine, counts to either side where it crosses at the particle
// itself.
constexpr double kGrazing = 0.01, kHere = 0.1;  // kHere: spacings of the crossings
constexpr double kRounding = 1e-5;              // of a particle's normal
constexpr std::size_t kBatch = 128;
constexpr double kWidestFlatSeed = 10.0;  // tolerances

/// A shuffled order that depends on the seed and the count alone [splitmix64].
std::uint64_t mix(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

}  // namespace

double widest_seed(const Sowing& sowing, const Surface& surface, const CrossingGrid& crossings,
                   const SizingLimits& limits) {
    constexpr double kSpacings = 5.0, kResolutions = 10.0;
    const double for_error = std::min(sowing.widest * limits.tolerance, kResolutions * surface.resolution());
    return std::min(limits.max_edge, std::max({kSpacings * crossings.spacing(), limits.min_edge, for_error}));
}

std::size_t cover(Particles& particles, const Surface& surface, const CrossingGrid& grid,
                  const SizingLimits& limits, std::uint64_t seed, Id& next_id, const Sowing& sowing) {
    if (grid.empty()) return 0;
    const double spacing = grid.spacing();
    std::vector<std::atomic<char>> covered(grid.size());  // marked by several threads
    /// What a particle covers. `else_reach`: where the surface is not flat.
    struct Disc {
        Vec3 p, n;
        double reach, else_reach;
    };
    const auto disc_of = [&](const Vec3& p, const Vec3& n, double reach, double else_reach) -> Disc {
        // A crossing lies within a cell's diagonal of its neighbours.
        return {p, n, std::max(reach, 1.2 * spacing), std::max(else_reach, 1.2 * spacing)};
    };
    const auto covers = [&](const Disc& disc, const Surface::Crossing& crossing) {
        const Vec3 way = crossing.point - disc.p;
        const double near = crossing.flat ? disc.reach : disc.else_reach;
        if (way.squaredNorm() > near * near ||
            std::abs(disc.n.dot(way)) >= std::max(kOffPlane * near, 0.5 * spacing))
            return false;
        const double facing = disc.n.dot(crossing.outward.cast<double>());
        return facing > kRounding ||
               (facing > -kGrazing && way.squaredNorm() < kHere * spacing * kHere * spacing);
    };
    // Of `some` of the crossings, which have these numbers.
    const auto mark = [&](const CrossingGrid& some, const auto& number, const Disc& disc) {
        const Vec3 reach = Vec3::Constant(disc.reach);
        some.for_each_in(Box(disc.p - reach, disc.p + reach), [&](std::size_t c) {
            if (!covered[number(c)].load(std::memory_order_relaxed) && covers(disc, some[c]))
                covered[number(c)].store(1, std::memory_order_relaxed);
        });
    };
    const auto own_number = [](std::size_t c) { return c; };
    const auto mark_all = [&](double share, const CrossingGrid& some, const auto& number) {
        constexpr std::size_t kParticles = 64;  // a thread's at least
        parallel_for_each(particles.size(), kParticles, [&](std::size_t i) {
            const double reach = share * particles.spacing[i];
            mark(some, number, disc_of(particles.position[i], particles.normal[i], reach, reach));
        });
    };
    if (particles.size() > 0) {
        mark_all(kNear, grid, own_number);
        std::vector<int> open;
        for (std::size_t c = 0; c < grid.size(); ++c)
            if (!covered[c]) open.push_back(static_cast<int>(c));
        const CrossingGrid open_alone = grid.some(open);
        mark_all(kReach, open_alone, [&](std::size_t c) { return static_cast<std::size_t>(open[c]); });
    }

    std::vector<std::pair<std::uint64_t, int>> order;
    order.reserve(std::count_if(covered.begin(), covered.end(), [](const auto& c) { return c == 0; }));
    for (std::size_t c = 0; c < grid.size(); ++c)
        if (!covered[c]) order.emplace_back(mix(seed ^ mix(c)), static_cast<int>(c));
    // Seeds are found side by side, a batch at a time; those that another of the batch covers were in vain.
    struct Seed {
        Vec3 position, normal;
        double spacing = 0.0;  // none: there is no surface here
    };
    ThreadProbes probes(surface);
    const double widest = widest_seed(sowing, surface, grid, limits),
                 widest_flat = std::max(widest, kWidestFlatSeed * limits.tolerance);
    const auto seed_at = [&](int c, Surface::Probe& probe) -> Seed {
        const Surface::Crossing crossing = grid[c];
        const Vec3 start = crossing.point;
        const auto p = probe.project(start);
        if (!p || (*p - start).norm() > 1.5 * surface.resolution()) return {};
        const Vec3 n = probe.normal(*p);
        if (!(n.squaredNorm() > 0.0)) return {};
        return {*p, n,
                std::min(spacing_from_curvature(probe, *p, n, spacing, limits),
                         crossing.flat ? widest_flat : widest)};
    };
    std::size_t added = 0;
    std::vector<int> batch;
    std::vector<Seed> seeds;
    const auto sow = [&](const auto& begin, const auto& end) {
        for (auto next = begin; next != end;) {
            for (batch.clear(); next != end && batch.size() < kBatch; ++next)
                if (const int c = next->second; !covered[c]) batch.push_back(c);
            seeds.assign(batch.size(), {});
            tbb::parallel_for(tbb::blocked_range<std::size_t>(0, batch.size(), 8), [&](const auto& range) {
                Surface::Probe& probe = probes.local();
                for (std::size_t i = range.begin(); i < range.end(); ++i) seeds[i] = seed_at(batch[i], probe);
            });
            std::vector<Disc> sown;
            for (std::size_t i = 0; i < batch.size(); ++i) {
                const Surface::Crossing crossing = grid[batch[i]];
                if (std::any_of(sown.begin(), sown.end(),
                                [&](const Disc& disc) { return covers(disc, crossing); }))
                    continue;
                covered[batch[i]] = 1;
                const auto& [p, n, h] = seeds[i];
                if (!(h > 0.0)) continue;
                particles.add(p, n, h, next_id++);
                sown.push_back(disc_of(p, n, sowing.apart * h, sowing.apart * std::min(h, widest)));
            }
            added += sown.size();
            parallel_for_each(sown.size(), 8, [&](std::size_t i) { mark(grid, own_number, sown[i]); });
        }
    };
    // Put in order a part at a time: most of the later ones are covered by then.
    constexpr int kParts = 16;
    for (std::uint64_t part = 1; part <= kParts; ++part) {
        order.erase(
            std::remove_if(order.begin(), order.end(), [&](const auto& o) { return covered[o.second] != 0; }),
            order.end());
        const auto end = std::partition(order.begin(), order.end(), [&](const auto& o) {
            return part == kParts || o.first < part * (~std::uint64_t{0} / kParts);
        });
        tbb::parallel_sort(order.begin(), end);
        sow(order.begin(), end);
    }
    return added;
}

}  // namespace isotrack
