// Moving particles to a good packing.
#pragma once

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Sweeps of the paper's coordinate descent: each particle in turn takes a Levenberg-Marquardt step on the
/// Gaussian energy of its neighbours, in its tangent plane, in the metric d^2 = (k_i^2 + k_j^2) / 2 |r|^2
/// with k = 1 / spacing, with the moving sigma_i = r_0 / sqrt(2), is projected back by O1, and stays there if
/// its energy fell. Neighbours are those of `adjacency` that face the same way. A particle that has a crease
/// of the surface within 0.4 of its spacing when the first sweep comes to it is put on it and moves along it
/// alone, brought back to it by each sweep; one that has a corner there stays in it. A particle rests when
/// neither it nor a neighbour moved by more than 0.05 sigma in the last sweep (the paper's threshold); ends
/// early when all rest. Of `restless`, a flag for each, only those that are set move; all when it is empty.
/// Blocks of particles of one colour move at the same time: the same result at any thread count. Returns the
/// sweeps made.
int relax(Particles& particles, const Adjacency& adjacency, const Surface& surface, int sweeps,
          const std::vector<char>& restless = {});

}  // namespace isotrack
