// Things on lattice lines in the third direction, layer by layer.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <utility>
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

/// Items with members x, y and z, ascending in these.
template <typename Item>
class LatticeLayers {
public:
    using Range = std::pair<const Item*, const Item*>;

    LatticeLayers() = default;
    explicit LatticeLayers(const std::vector<Item>& items) {
        if (items.empty()) return;
        constexpr std::size_t kBlock = 65536;
        const std::size_t blocks = (items.size() + kBlock - 1) / kBlock;
        const auto for_each_block = [&](const auto& body) {
            tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t b) {
                body(b, items.begin() + static_cast<std::ptrdiff_t>(b * kBlock),
                     items.begin() + static_cast<std::ptrdiff_t>(std::min(items.size(), (b + 1) * kBlock)));
            });
        };
        std::vector<std::pair<int, int>> ranges(blocks);
        for_each_block([&](std::size_t b, auto from, auto to) {
            const auto [low, high] =
                std::minmax_element(from, to, [](const Item& p, const Item& q) { return p.x < q.x; });
            ranges[b] = {low->x, high->x};
        });
        int high_x = ranges[0].second;
        low_x_ = ranges[0].first;
        for (const auto& [low, high] : ranges) {
            low_x_ = std::min(low_x_, low);
            high_x = std::max(high_x, high);
        }
        const auto layers = static_cast<std::size_t>(high_x - low_x_) + 1;
        std::vector<std::vector<std::size_t>> next(blocks);  // at first the count of each layer
        for_each_block([&](std::size_t b, auto from, auto to) {
            next[b].assign(layers, 0);
            for (; from != to; ++from) ++next[b][from->x - low_x_];
        });
        first_.assign(layers + 1, 0);
        std::size_t at = 0;
        for (std::size_t layer = 0; layer < layers; ++layer) {
            first_[layer] = at;
            for (auto& of_block : next) at += std::exchange(of_block[layer], at);
        }
        first_[layers] = at;
        items_.resize(items.size());
        for_each_block([&](std::size_t b, auto from, auto to) {
            for (; from != to; ++from) items_[next[b][from->x - low_x_]++] = *from;
        });
        tbb::parallel_for(std::size_t{0}, layers, [&](std::size_t i) {
            sort_by_line(items_.data() + first_[i], items_.data() + first_[i + 1]);
        });
    }

    /// The layers from `low_x()` up to, but not including, `end_x()` may hold items.
    int low_x() const { return low_x_; }
    int end_x() const { return low_x_ + static_cast<int>(first_.size()) - 1; }
    bool empty() const { return items_.empty(); }
    Range layer(int x) const {
        if (x < low_x() || x >= end_x()) return {nullptr, nullptr};
        const auto at = static_cast<std::size_t>(x - low_x_);
        return {items_.data() + first_[at], items_.data() + first_[at + 1]};
    }

private:
    int low_x_ = 0;
    std::vector<Item> items_;
    std::vector<std::size_t> first_ = {0};  // of each layer, and the end
};

}  // namespace isotrack
