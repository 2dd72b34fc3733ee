// Files hold floats: what is certified must be what is written.
#pragma once

#include "isotrack/types.h"

namespace isotrack {

/// The point that a file will hold.
inline Vec3 to_float_precision(const Vec3& p) {
    // Through memory: g++ 12 takes the way to float and back for nothing when it vectorises it (-O2 and -O3).
    const auto rounded = [](double x) {
        const volatile float single = static_cast<float>(x);
        return static_cast<double>(single);
    };
    return {rounded(p.x()), rounded(p.y()), rounded(p.z())};
}

}  // namespace isotrack
