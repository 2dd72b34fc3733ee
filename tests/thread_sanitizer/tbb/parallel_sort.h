// In front of TBB's header of that name when the thread sanitizer is on: that one brings TBB's parallel_for
// with it. Only OpenVDB sorts so, and nothing of ours.
#pragma once

#include <algorithm>

namespace tbb {

template <typename Iterator, typename... Less>
void parallel_sort(Iterator first, Iterator last, const Less&... less) {
    std::sort(first, last, less...);
}

}  // namespace tbb
