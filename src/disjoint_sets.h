// Which of some numbers belong together.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace isotrack {

/// Each of 0 to `count` - 1 is alone at first.
class DisjointSets {
public:
    explicit DisjointSets(std::size_t count) : parent_(count) {
        std::iota(parent_.begin(), parent_.end(), 0);
    }

    /// The least of those that `i` belongs to.
    int least(int i) {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    /// Returns whether they were apart.
    bool join(int i, int j) {
        i = least(i), j = least(j);
        // Neighbours are mostly close in memory, and so are the least.
        parent_[std::max(i, j)] = std::min(i, j);
        return i != j;
    }

private:
    std::vector<int> parent_;
};

}  // namespace isotrack
