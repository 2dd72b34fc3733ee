#include "isotrack/sampling/adjacency.h"

#include <cstdint>

namespace isotrack {

Adjacency Adjacency::restricted(const std::vector<char>& keep) const {
    std::vector<int> number(size(), -1);
    int count = 0;
    for (std::size_t i = 0; i < size(); ++i)
        if (keep[i]) number[i] = count++;
    Adjacency result;
    for (std::size_t i = 0; i < size(); ++i) {
        if (!keep[i]) continue;
        for (const int j : of(i))
            if (keep[j]) result.adjacent.push_back(number[j]);
        result.first.push_back(static_cast<int>(result.adjacent.size()));
    }
    return result;
}

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
