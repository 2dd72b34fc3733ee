// Things on lattice lines in the third direction.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <vector>

namespace isotrack {

/// Sorts items of one layer by their y, those of one line by their z.
template <typename Item>
void sort_by_line(Item* begin, Item* end) {
    constexpr std::size_t kLinesPerItem = 8;
    const auto less = [](const Item& a, const Item& b) { return std::tie(a.y, a.z) < std::tie(b.y, b.z); };
    const auto count = static_cast<std::size_t>(end - begin);
    if (count < 2) return;
    const auto [low, high] =
        std::minmax_element(begin, end, [](const Item& a, const Item& b) { return a.y < b.y; });
    const int low_y = low->y;
    const auto lines = static_cast<std::size_t>(static_cast<std::int64_t>(high->y) - low_y + 1);
    if (lines > kLinesPerItem * count) {
        std::sort(begin, end, less);
        return;
    }
    // Each to its line, where there are few.
    std::vector<std::size_t> first(lines + 1, 0);
    for (const Item* item = begin; item != end; ++item) ++first[item->y - low_y + 1];
    for (std::size_t line = 1; line <= lines; ++line) first[line] += first[line - 1];
    std::vector<std::size_t> next(first.begin(), first.end() - 1);
    const std::vector<Item> unsorted(begin, end);
    for (const Item& item : unsorted) begin[next[item.y - low_y]++] = item;
    for (std::size_t line = 0; line < lines; ++line)
        std::sort(begin + first[line], begin + first[line + 1], less);
}

}  // namespace isotrack
