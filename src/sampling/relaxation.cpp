#include "isotrack/sampling/relaxation.h"

#include <tbb/parallel_for.h>

#include "sampling/descent.h"
#include "surface/thread_probes.h"

namespace isotrack {

int relax(Particles& particles, const Adjacency& adjacency, const Surface& surface, int sweeps) {
    const auto groups = colour_groups(adjacency);
    ThreadProbes probes(surface);
    std::vector<Metric> metrics;
    for (std::size_t i = 0; i < particles.size(); ++i) metrics.push_back(metric_of(particles, i));
    std::vector<double> lambda(particles.size(), 0.1);
    std::vector<char> moved(particles.size(), 1), active(particles.size(), 1);
    int done = 0;
    for (; done < sweeps; ++done) {
        if (done > 0) {
            bool any = false;
            for (std::size_t i = 0; i < particles.size(); ++i) {
                active[i] = moved[i];
                for (const int j : adjacency.of(i)) active[i] = active[i] || moved[j];
                any = any || active[i];
            }
            if (!any) break;
        }
        for (const auto& group : groups)
            tbb::parallel_for(tbb::blocked_range<std::size_t>(0, group.size(), 64), [&](const auto& range) {
                Surface::Probe& probe = probes.local();
                for (std::size_t g = range.begin(); g < range.end(); ++g) {
                    const int i = group[g];
                    moved[i] =
                        active[i] && descend(particles, metrics, adjacency.of(i), i, lambda[i], probe).moved >
                                         kRestThreshold;
                }
            });
    }
    return done;
}

}  // namespace isotrack
