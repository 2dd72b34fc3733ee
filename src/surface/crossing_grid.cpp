#include "isotrack/surface/crossing_grid.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <atomic>
#include <cmath>
#include <tuple>

namespace isotrack {

namespace {

/// Of crossings: the box around them and their different directions.
struct Extent {
    Box box;
    std::vector<Eigen::Vector3f> directions{};

    void add(const Eigen::Vector3f& direction) {
        if (std::find(directions.begin(), directions.end(), direction) == directions.end())
            directions.push_back(direction);
    }
};

}  // namespace

CrossingGrid::CrossingGrid(double spacing, const Surface::CrossingSequence& crossings)
    : spacing_(spacing), width_(2.0 * spacing) {
    constexpr double kColumnsPerCrossing = 4.0;
    if (crossings.size == 0) return;
    const auto range_of_all = tbb::blocked_range<std::size_t>(0, crossings.size, 4096);
    const Extent extent = tbb::parallel_reduce(
        range_of_all, Extent(),
        [&](const auto& range, Extent sum) {
            for (std::size_t c = range.begin(); c < range.end(); ++c) {
                const Surface::Crossing crossing = crossings.at(c);
                sum.box.extend(crossing.point);
                sum.add(crossing.outward);
            }
            return sum;
        },
        [](Extent a, const Extent& b) {
            a.box.extend(b.box);
            for (const Eigen::Vector3f& direction : b.directions) a.add(direction);
            return a;
        });
    const Box& box = extent.box;
    directions_ = extent.directions;
    std::sort(directions_.begin(), directions_.end(), [](const auto& a, const auto& b) {
        return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
    });
    origin_ = box.min();
    const double most = kColumnsPerCrossing * static_cast<double>(crossings.size);
    const Vec3 size = box.sizes();
    width_ = std::max({width_, std::sqrt(size.x() * size.y() / most), size.x() / most, size.y() / most});
    for (int axis = 0; axis < 2; ++axis) count_[axis] = static_cast<int>(size[axis] / width_) + 1;

    const std::size_t columns = static_cast<std::size_t>(count_[0]) * count_[1];
    first_.assign(columns + 1, 0);
    const auto offset_of = [&](const Surface::Crossing& c) -> Eigen::Vector3f {
        return (c.point - origin_).cast<float>();
    };
    // Each goes to the next free place of its column, in any order: they are sorted then.
    std::vector<std::atomic<std::uint32_t>> next(columns);
    tbb::parallel_for(range_of_all, [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c)
            next[column_of(offset_of(crossings.at(c)))].fetch_add(1, std::memory_order_relaxed);
    });
    for (std::size_t c = 0; c < columns; ++c) {
        first_[c + 1] = first_[c] + next[c].load(std::memory_order_relaxed);
        next[c].store(0, std::memory_order_relaxed);
    }
    entries_.resize(crossings.size);
    tbb::parallel_for(range_of_all, [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
            const Surface::Crossing crossing = crossings.at(c);
            const Eigen::Vector3f offset = offset_of(crossing);
            const std::size_t column = column_of(offset);
            const auto direction = std::find(directions_.begin(), directions_.end(), crossing.outward);
            entries_[first_[column] + next[column].fetch_add(1, std::memory_order_relaxed)] = {
                offset, static_cast<std::uint32_t>(direction - directions_.begin()),
                static_cast<std::uint32_t>(crossing.stands_for), crossing.flat};
        }
    });
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns, 256), [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c)
            std::sort(entries_.begin() + static_cast<std::ptrdiff_t>(first_[c]),
                      entries_.begin() + static_cast<std::ptrdiff_t>(first_[c + 1]),
                      [](const Entry& a, const Entry& b) {
                          return std::make_tuple(a.offset.z(), a.offset.x(), a.offset.y(), a.direction) <
                                 std::make_tuple(b.offset.z(), b.offset.x(), b.offset.y(), b.direction);
                      });
    });
}

std::vector<char> CrossingGrid::columns_of(const std::vector<int>& some) const {
    std::vector<char> result(first_.empty() ? 0 : first_.size() - 1, 0);
    for (const int i : some) result[column_of(entries_[i].offset)] = 1;
    return result;
}

}  // namespace isotrack
