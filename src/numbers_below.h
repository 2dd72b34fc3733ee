// 0, 1, 2, ...
#pragma once

#include <cstddef>
#include <numeric>
#include <vector>

namespace isotrack {

inline std::vector<int> numbers_below(std::size_t count) {
    std::vector<int> result(count);
    std::iota(result.begin(), result.end(), 0);
    return result;
}

}  // namespace isotrack
