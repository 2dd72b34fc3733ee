#include "isotrack/meshing/fit.h"

#include <algorithm>
#include <iterator>

#include "meshing/fit_steps.h"

namespace isotrack {
namespace {

constexpr int kStepsPerReading = 2;

}  // namespace

void fit(std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles, const Surface& surface,
         int steps, const std::vector<char>& movable, double damping) {
    const std::vector<char> all(movable.empty() ? vertices.size() : 0, 1);
    const std::vector<char>& moves = movable.empty() ? all : movable;
    const bool all_move = std::find(moves.begin(), moves.end(), 0) == moves.end();
    std::vector<Triangle> some;
    if (!all_move)
        std::copy_if(triangles.begin(), triangles.end(), std::back_inserter(some),
                     [&](const Triangle& t) { return moves[t[0]] || moves[t[1]] || moves[t[2]]; });
    const std::vector<Triangle>& moving = all_move ? triangles : some;
    const Corners corners(vertices.size(), moving);
    for (; steps > 0; steps -= kStepsPerReading)
        fit_steps(vertices, moving, corners, facet_values(vertices, moving, corners, surface), surface,
                  std::min(steps, kStepsPerReading), moves, damping);
}

}  // namespace isotrack
