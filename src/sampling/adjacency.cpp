#include "isotrack/sampling/adjacency.h"

#include <cstdint>

namespace isotrack {

std::vector<std::vector<int>> colour_groups(const Adjacency& adjacency) {
    std::vector<int> colour(adjacency.size(), -1);
    std::vector<std::vector<int>> groups;
    std::vector<char> taken;
    for (std::size_t i = 0; i < adjacency.size(); ++i) {
        taken.assign(groups.size() + 1, 0);
        for (const int j : adjacency.of(i))
            if (colour[j] >= 0) taken[colour[j]] = 1;
        int c = 0;
        while (taken[c]) ++c;
        if (c == static_cast<int>(groups.size())) groups.emplace_back();
        colour[i] = c;
        groups[c].push_back(static_cast<int>(i));
    }
    return groups;
}

}  // namespace isotrack
