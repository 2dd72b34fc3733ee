#include "isotrack/surface/crossing_grid.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <tuple>

namespace isotrack {

CrossingGrid::CrossingGrid(std::vector<Surface::Crossing> crossings, double spacing)
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
    const auto column_of = [&](const Surface::Crossing& c) {
        return static_cast<std::size_t>(column(0, c.point.x())) * count_[1] + column(1, c.point.y());
    };
    first_.assign(columns + 1, 0);
    for (const auto& c : crossings) ++first_[column_of(c) + 1];
    for (std::size_t c = 0; c < columns; ++c) first_[c + 1] += first_[c];
    std::vector<std::size_t> end(first_.begin(), first_.end() - 1);
    crossings_.resize(crossings.size());
    for (const auto& c : crossings) crossings_[end[column_of(c)]++] = c;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns, 256), [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c)
            std::sort(crossings_.begin() + static_cast<std::ptrdiff_t>(first_[c]),
                      crossings_.begin() + static_cast<std::ptrdiff_t>(first_[c + 1]),
                      [](const Surface::Crossing& a, const Surface::Crossing& b) {
                          return std::tie(a.point.z(), a.point.x(), a.point.y()) <
                                 std::tie(b.point.z(), b.point.x(), b.point.y());
                      });
    });
}

std::vector<char> CrossingGrid::columns_of(const std::vector<char>& wanted) const {
    std::vector<char> result(first_.empty() ? 0 : first_.size() - 1, 0);
    for (std::size_t column = 0; column < result.size(); ++column)
        for (std::size_t c = first_[column]; c < first_[column + 1] && !result[column]; ++c)
            result[column] = wanted[c];
    return result;
}

}  // namespace isotrack
