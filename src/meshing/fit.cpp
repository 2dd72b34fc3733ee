#include "isotrack/meshing/fit.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "meshing/fit_steps.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr int kStepsPerReading = 5;

}  // namespace

void fit(std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles, const Surface& surface,
         int steps, const std::vector<char>& movable, double damping) {
    const std::vector<char> all(movable.empty() ? vertices.size() : 0, 1);
    const std::vector<char>& moves = movable.empty() ? all : movable;
    std::vector<FacetValues> facets(triangles.size());
    ThreadProbes probes(surface);
    for (; steps > 0; steps -= kStepsPerReading) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles.size(), 64), [&](const auto& range) {
            Surface::Probe& probe = probes.local();
            for (std::size_t t = range.begin(); t < range.end(); ++t) {
                const auto& [i, j, k] = triangles[t];
                if (any_moves(triangles[t], moves))
                    facets[t] = FacetValues(vertices[i], vertices[j], vertices[k], probe);
            }
        });
        fit_steps(vertices, triangles, facets, surface, std::min(steps, kStepsPerReading), moves, damping);
    }
}

}  // namespace isotrack
