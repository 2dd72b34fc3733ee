// Who is nearer to a neighbour than they want to be.
#pragma once

#include <utility>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "sampling/metric.h"

namespace isotrack {

/// Those whose nearest neighbour is less than `crowded` away, in units of the spacing: the squared distance
/// to it, and the particle, by whose number they are in ascending order. `metrics`: of each particle. Uses
/// TBB inside.
std::vector<std::pair<double, int>> find_crowded(const Particles& particles,
                                                 const std::vector<Metric>& metrics,
                                                 const Adjacency& adjacency, double crowded);

}  // namespace isotrack
