// Something done with every number below another, by several threads.
#pragma once

#include <tbb/parallel_for.h>

#include <cstddef>

namespace isotrack {

/// `body(i)` for i from 0 to before `count`, `grain` or more of them at a time by one thread.
template <typename Body>
void parallel_for_each(std::size_t count, std::size_t grain, const Body& body) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) body(i);
    });
}

}  // namespace isotrack
