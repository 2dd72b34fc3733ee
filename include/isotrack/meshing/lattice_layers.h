// Things on lattice lines in the third direction, layer by layer.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace isotrack {

/// Items with a member x, sorted by it and within each layer by a criterion of one's own.
template <typename Item>
class LatticeLayers {
public:
    using Range = std::pair<const Item*, const Item*>;

    LatticeLayers() = default;
    /// `less` compares items of one layer.
    template <typename Less>
    LatticeLayers(const std::vector<Item>& items, const Less& less) {
        if (items.empty()) return;
        const auto [low, high] = std::minmax_element(items.begin(), items.end(),
                                                     [](const Item& a, const Item& b) { return a.x < b.x; });
        low_x_ = low->x;
        first_.assign(static_cast<std::size_t>(high->x - low_x_) + 2, 0);
        for (const Item& item : items) ++first_[item.x - low_x_ + 1];
        for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
        std::vector<std::size_t> end(first_.begin(), first_.end() - 1);
        items_.resize(items.size());
        for (const Item& item : items) items_[end[item.x - low_x_]++] = item;
        tbb::parallel_for(std::size_t{0}, first_.size() - 1, [&](std::size_t i) {
            std::sort(items_.begin() + static_cast<std::ptrdiff_t>(first_[i]),
                      items_.begin() + static_cast<std::ptrdiff_t>(first_[i + 1]), less);
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
