// Directions to look in, all around.
#pragma once

#include <array>
#include <cmath>

namespace isotrack {

/// The cosines and sines of eight angles, from 0 on, an eighth of a turn apart.
inline const std::array<std::array<double, 2>, 8>& ways_around() {
    static const auto ways = [] {
        std::array<std::array<double, 2>, 8> result;
        for (int way = 0; way < 8; ++way) {
            const double angle = way * (2.0 * M_PI / 8);
            result[way] = {std::cos(angle), std::sin(angle)};
        }
        return result;
    }();
    return ways;
}

}  // namespace isotrack
