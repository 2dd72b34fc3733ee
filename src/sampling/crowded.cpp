#include "sampling/crowded.h"

#include <algorithm>
#include <limits>

#include "find_in_blocks.h"

namespace isotrack {

std::vector<std::pair<double, int>> find_crowded(const Particles& particles,
                                                 const std::vector<Metric>& metrics,
                                                 const Adjacency& adjacency, double crowded) {
    constexpr std::size_t kBlock = 1024;
    using Crowded = std::pair<double, int>;
    return find_in_blocks<Crowded>(
        particles.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<Crowded>& found) {
            for (std::size_t n = begin; n < end; ++n) {
                const int i = static_cast<int>(n);
                double least = std::numeric_limits<double>::infinity();
                for (const int j : adjacency.of(n))
                    least = std::min(least, square_between(particles, metrics, i, j));
                if (least < crowded * crowded) found.emplace_back(least, i);
            }
        });
}

}  // namespace isotrack
