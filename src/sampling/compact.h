// Leaving out and reordering entries of what is stored per particle.
#pragma once

#include <cstddef>
#include <vector>

namespace isotrack {

/// Keeps, in order, the entries whose flag is set.
template <typename T>
void compact(std::vector<T>& values, const std::vector<char>& keep) {
    std::size_t to = 0;
    for (std::size_t from = 0; from < values.size(); ++from)
        if (keep[from]) values[to++] = values[from];
    values.resize(to);
}

/// Entry i becomes that of order[i].
template <typename T>
void reorder(std::vector<T>& values, const std::vector<int>& order) {
    std::vector<T> result;
    result.reserve(order.size());
    for (const int i : order) result.push_back(values[i]);
    values.swap(result);
}

/// The number that each entry has then; -1 for those left out.
inline std::vector<int> numbers_after(const std::vector<char>& keep) {
    std::vector<int> result(keep.size(), -1);
    int count = 0;
    for (std::size_t i = 0; i < keep.size(); ++i)
        if (keep[i]) result[i] = count++;
    return result;
}

}  // namespace isotrack
