#include "isotrack/sampling/relaxation.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>

#include "sampling/creases.h"
#include "sampling/descent.h"
#include "surface/thread_probes.h"

namespace isotrack {

namespace {

// From 16 to 128 take the same time. Another length is another order of moves, and so another packing.
constexpr int kLongestBlock = 16;

}  // namespace

int relax(Particles& particles, const Adjacency& adjacency, const Surface& surface, int sweeps,
          const std::vector<char>& restless) {
    std::vector<std::vector<ParticleBlock>> groups;
    std::vector<Crease> crease;
    std::vector<Metric> metrics;
    std::vector<double> lambda(particles.size(), 0.1);
    tbb::parallel_invoke([&] { groups = colour_groups(adjacency, kLongestBlock, restless); },
                         [&] {
                             crease.resize(particles.size());
                             metrics = metrics_of(particles);
                         });
    ThreadProbes probes(surface);
    std::vector<char> active = restless;
    if (active.empty()) active.assign(particles.size(), 1);
    std::vector<char> moved = active;  // in the last sweep; those that rest are in no group or stay
    int done = 0;
    const auto step = [&](int i, Surface::Probe& probe) {
        // Who is on a crease in the first sweep is brought back to it in the next ones.
        if (done == 0 || crease[i].kind != Crease::Kind::None)
            crease[i] = pull_to_crease(particles, adjacency.of(i), i, surface.resolution(), probe);
        if (crease[i].kind == Crease::Kind::Corner) return false;
        const Vec3* along = crease[i].kind == Crease::Kind::Line ? &crease[i].along : nullptr;
        return descend(particles, metrics, adjacency.of(i), i, lambda[i], probe, along).moved >
               kRestThreshold;
    };
    for (; done < sweeps; ++done) {
        if (done > 0) {
            if (std::find(moved.begin(), moved.end(), 1) == moved.end()) break;
            tbb::parallel_for(
                tbb::blocked_range<std::size_t>(0, active.size(), 1024), [&](const auto& range) {
                    for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        const Adjacency::Range near = adjacency.of(i);
                        if (!restless.empty() && !restless[i]) continue;
                        active[i] = moved[i] || std::any_of(near.begin(), near.end(),
                                                            [&](int j) { return moved[j] != 0; });
                    }
                });
        }
        for (const auto& group : groups)
            tbb::parallel_for(tbb::blocked_range<std::size_t>(0, group.size()), [&](const auto& range) {
                Surface::Probe& probe = probes.local();
                for (std::size_t b = range.begin(); b < range.end(); ++b)
                    for (int i = group[b].begin; i < group[b].end; ++i)
                        moved[i] = active[i] && step(i, probe);
            });
    }
    return done;
}

}  // namespace isotrack
