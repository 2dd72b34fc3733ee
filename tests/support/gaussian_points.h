// Points in general position.
#pragma once

#include <random>
#include <vector>

#include "isotrack/types.h"

namespace isotrack::support {

inline std::vector<Vec3> gaussian_points(int n, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> u;
    std::vector<Vec3> points;
    for (int i = 0; i < n; ++i) points.emplace_back(u(random), u(random), u(random));
    return points;
}

}  // namespace isotrack::support
