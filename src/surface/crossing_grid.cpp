#include "isotrack/surface/crossing_grid.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <tuple>

namespace isotrack {

CrossingGrid::CrossingGrid(const std::vector<Surface::Crossing>& crossings, double spacing)
    : spacing_(spacing), width_(2.0 * spacing) {
    constexpr double kColumnsPerCrossing = 4.0;
    if (crossings.empty()) return;
    Box box;
    for (const auto& c : crossings) box.extend(c.point);
    origin_ = box.min();
    const double most = kColumnsPerCrossing * static_cast<double>(crossings.size());
    const Vec3 size = box.sizes();
    width_ = std::max({width_, std::sqrt(size.x() * size.y() / most), size.x() / most, size.y() / most});
    for (int axis = 0; axis < 2; ++axis) count_[axis] = static_cast<int>(size[axis] / width_) + 1;

    const std::size_t columns = static_cast<std::size_t>(count_[0]) * count_[1];
    first_.assign(columns + 1, 0);
    const auto entry_of = [&](const Surface::Crossing& c) {
        return Entry{(c.point - origin_).cast<float>(), direction_of(c.outward)};
    };
    for (const auto& c : crossings) ++first_[column_of(entry_of(c)) + 1];
    for (std::size_t c = 0; c < columns; ++c) first_[c + 1] += first_[c];
    std::vector<std::size_t> end(first_.begin(), first_.end() - 1);
    entries_.resize(crossings.size());
    for (const auto& c : crossings) {
        const Entry entry = entry_of(c);
        entries_[end[column_of(entry)]++] = entry;
    }
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns, 256), [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c)
            std::sort(entries_.begin() + static_cast<std::ptrdiff_t>(first_[c]),
                      entries_.begin() + static_cast<std::ptrdiff_t>(first_[c + 1]),
                      [](const Entry& a, const Entry& b) {
                          return std::make_tuple(a.offset.z(), a.offset.x(), a.offset.y()) <
                                 std::make_tuple(b.offset.z(), b.offset.x(), b.offset.y());
                      });
    });
}

std::uint32_t CrossingGrid::direction_of(const Eigen::Vector3f& outward) {
    const auto known = std::find(directions_.begin(), directions_.end(), outward);
    const auto number = static_cast<std::uint32_t>(known - directions_.begin());
    if (known == directions_.end()) directions_.push_back(outward);
    return number;
}

std::vector<char> CrossingGrid::columns_of(const std::vector<int>& some) const {
    std::vector<char> result(first_.empty() ? 0 : first_.size() - 1, 0);
    for (const int i : some) result[column_of(entries_[i])] = 1;
    return result;
}

}  // namespace isotrack
