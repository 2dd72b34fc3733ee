// Points to hold surfaces against the unit sphere at.
#pragma once

#include <random>
#include <vector>

#include "isotrack/types.h"

namespace isotrack::support {

/// Random directions on the unit sphere times (1 + offset).
inline std::vector<Vec3> near_sphere(std::size_t count, double offset, unsigned seed = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> shift(-offset, offset);
    std::vector<Vec3> points;
    while (points.size() < count) {
        const Vec3 n = Vec3(normal(random), normal(random), normal(random)).normalized();
        points.push_back((1.0 + shift(random)) * n);
    }
    return points;
}

}  // namespace isotrack::support
