// The paper's own sampling: a queue of candidates, one particle after the other, with births and deaths on
// the way.
#pragma once

#include <cstdint>
#include <vector>

#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// What the descent asks of the structure that knows the neighbours (the DT, or anything like it). Particles
/// are named by their index.
class MovingNeighbours {
public:
    virtual ~MovingNeighbours() = default;
    virtual void neighbours(int i, std::vector<int>& result) = 0;
    virtual void moved(int i, const Vec3& to) = 0;
    virtual void added(int i, const Vec3& at, int near) = 0;  ///< i is the count of particles before.
    virtual void removed(int i) = 0;
    virtual void settle() = 0;  ///< Called about once per sweep, for structures that only note changes.
};

struct CoordinateDescentOptions {
    double sigma_min =
        0.5;  ///< In the metric in which the wanted spacing is 1: below it a particle is deleted ...
    double sigma_max = 1.0;  ///< ... above it, it splits. The paper: sigma_max about 2 sigma_min.
    bool population = true;  ///< False: no births or deaths.
    int most_sweeps = 40;    ///< Steps allowed per particle.
    std::uint64_t seed = 1;
};

struct CoordinateDescentReport {
    std::size_t steps = 0, born = 0, died = 0;
    bool converged = false;  ///< The queue ran empty within the budget.
};

/// The paper's algorithm 1. The metric of a particle, k^2 = max(k_nd^2, 1 / th^2) of its DT neighbours, is
/// renewed at each of its steps, as the spacing at which neighbours' normals differ by `limits.angle`, kept
/// between the smallest and the largest edge. Deleted particles are taken out at the end, the others keep
/// their order.
CoordinateDescentReport coordinate_descent(Particles& particles, MovingNeighbours& structure,
                                           const Surface& surface, const SizingLimits& limits, Id& next_id,
                                           const CoordinateDescentOptions& options = {});

}  // namespace isotrack
