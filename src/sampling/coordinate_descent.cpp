#include "isotrack/sampling/coordinate_descent.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <random>

#include "sampling/descent.h"

namespace isotrack {
namespace {

/// The paper's k_i (3.3.3) as a spacing.
double spacing_in_paper(const Particles& particles, const std::vector<int>& neighbours, int i,
                        const SizingLimits& limits) {
    double k_nd2 = 0.0, th2 = std::numeric_limits<double>::infinity();
    for (const int j : neighbours) {
        const double cosine = particles.normal[i].dot(particles.normal[j]);
        const double r2 = (particles.position[j] - particles.position[i]).squaredNorm();
        if (cosine > 0.0 && r2 > 0.0)
            k_nd2 = std::max(k_nd2, (1.0 - cosine) / r2);
        else if (cosine < 0.0)
            th2 = std::min(th2, r2);
    }
    const double k = std::sqrt(std::max(k_nd2, 1.0 / th2));
    // A constant distance d in the metric is a constant angle between normals: t = sqrt(2) d.
    const double h = k > 0.0 ? limits.angle / (std::sqrt(2.0) * k) : limits.max_edge;
    return std::clamp(h, limits.min_edge, limits.max_edge);
}

}  // namespace

CoordinateDescentReport coordinate_descent(Particles& particles, MovingNeighbours& structure,
                                           const Surface& surface, const SizingLimits& limits, Id& next_id,
                                           const CoordinateDescentOptions& options) {
    CoordinateDescentReport report;
    const auto probe = surface.probe();
    std::mt19937_64 random(options.seed);
    std::vector<char> alive(particles.size(), 1), queued(particles.size(), 1);
    std::vector<double> lambda(particles.size(), 0.1);
    std::vector<Metric> metrics = metrics_of(particles);
    std::deque<int> candidates;
    for (std::size_t i = 0; i < particles.size(); ++i) candidates.push_back(static_cast<int>(i));
    const auto push = [&](int i) {
        if (queued[i] || !alive[i]) return;
        queued[i] = 1;
        candidates.push_back(i);
    };

    std::vector<int> neighbours;
    const std::size_t start = particles.size();
    const std::size_t budget = start * static_cast<std::size_t>(std::max(0, options.most_sweeps));
    std::size_t since_settled = 0;
    while (!candidates.empty() && report.steps < budget) {
        const int i = candidates.front();
        candidates.pop_front();
        queued[i] = 0;
        if (!alive[i]) continue;
        if (++since_settled > particles.size()) {
            structure.settle();
            since_settled = 0;
        }
        ++report.steps;
        structure.neighbours(i, neighbours);
        particles.spacing[i] = spacing_in_paper(particles, neighbours, i, limits);
        metrics[i] = metric_of(particles, i);
        const DescentStep step =
            descend(particles, metrics, {neighbours.data(), neighbours.data() + neighbours.size()}, i,
                    lambda[i], *probe);
        if (step.moved > 0.0) structure.moved(i, particles.position[i]);
        if (step.moved > kRestThreshold) {
            push(i);
            const double near = 2.0 * step.sigma * particles.spacing[i];
            for (const int j : neighbours)
                if ((particles.position[j] - particles.position[i]).norm() < near) push(j);
            continue;
        }
        if (!options.population || !std::isfinite(step.sigma)) continue;
        if (step.sigma < options.sigma_min) {
            alive[i] = 0;
            ++report.died;
            structure.removed(i);
            for (const int j : neighbours) push(j);
        } else if (step.sigma > options.sigma_max && report.born < 8 * start + 64) {
            // One stays, the other starts a little to the side, in a tangent direction without preference.
            const double angle = std::uniform_real_distribution<double>(0.0, 6.283185307179586)(random);
            const Vec3& n = particles.normal[i];
            const Vec3 a = n.unitOrthogonal(), side = std::cos(angle) * a + std::sin(angle) * n.cross(a);
            const auto p =
                probe->project(particles.position[i] + 0.5 * step.sigma * particles.spacing[i] * side);
            if (!p) continue;
            const int twin = static_cast<int>(particles.size());
            particles.add(*p, probe->normal(*p), particles.spacing[i], next_id++, particles.velocity[i]);
            alive.push_back(1);
            queued.push_back(0);
            lambda.push_back(0.1);
            metrics.push_back(metrics[i]);
            ++report.born;
            structure.added(twin, *p, i);
            push(i);
            push(twin);
        }
    }
    report.converged = candidates.empty();
    particles.retain(alive);
    return report;
}

}  // namespace isotrack
