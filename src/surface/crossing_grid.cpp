#include "isotrack/surface/crossing_grid.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <atomic>
#include <cmath>
#include <mutex>
#include <numeric>
#include <tuple>
#include <utility>

namespace isotrack {

namespace {

/// Different directions, numbered as they are met by several threads.
class Directions {
public:
    std::uint32_t number_of(const Eigen::Vector3f& direction) {
        const std::lock_guard lock(mutex_);
        const auto number =
            static_cast<std::uint32_t>(std::find(all_.begin(), all_.end(), direction) - all_.begin());
        if (number == all_.size()) all_.push_back(direction);
        return number;
    }
    const std::vector<Eigen::Vector3f>& all() const { return all_; }

private:
    std::mutex mutex_;
    std::vector<Eigen::Vector3f> all_;
};

Box box_around(const Surface::CrossingSequence& crossings) {
    Box box;
    for (std::size_t c = 0; c < crossings.size; ++c) box.extend(crossings.at(c).point);
    return box;
}

}  // namespace

// In braces, from left to right: the box is of crossings that are still there.
CrossingGrid::CrossingGrid(Surface::CrossingSequence crossings, double spacing)
    : CrossingGrid{spacing, box_around(crossings), std::move(crossings)} {}

CrossingGrid::CrossingGrid(double spacing, const Vec3& origin, const Vec3& size, std::size_t crossings)
    : origin_(origin), size_(size), spacing_(spacing), width_(2.0 * spacing) {
    constexpr double kColumnsPerCrossing = 4.0;
    if (crossings == 0) return;
    const double most = kColumnsPerCrossing * static_cast<double>(crossings);
    width_ = std::max({width_, std::sqrt(size.x() * size.y() / most), size.x() / most, size.y() / most});
    for (int axis = 0; axis < 2; ++axis) count_[axis] = static_cast<int>(size[axis] / width_) + 1;
    first_.assign(static_cast<std::size_t>(count_[0]) * count_[1] + 1, 0);
}

CrossingGrid::CrossingGrid(double spacing, const Box& box, Surface::CrossingSequence crossings)
    : CrossingGrid(spacing, box.min(), box.sizes(), crossings.size) {
    if (crossings.size == 0) return;
    const std::size_t columns = first_.size() - 1;
    // Each goes to the next free place of its column, in any order: they are sorted then. To make them takes
    // longer than anything else here, so they are held twice, which is about as much as a frame needs later.
    // Blocks made and freed on the way would take more: a thread's heap keeps what was freed.
    Entries made(crossings.size);
    std::vector<std::atomic<std::uint32_t>> next(columns);
    Directions directions;
    const auto range_of_all = tbb::blocked_range<std::size_t>(0, crossings.size, Entries::kBlock);
    tbb::parallel_for(range_of_all, [&](const auto& range) {
        std::vector<std::pair<Eigen::Vector3f, std::uint32_t>> known;
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
            const Surface::Crossing crossing = crossings.at(c);
            auto direction = std::find_if(known.begin(), known.end(),
                                          [&](const auto& k) { return k.first == crossing.outward; });
            if (direction == known.end())
                direction =
                    known.insert(known.end(), {crossing.outward, directions.number_of(crossing.outward)});
            Entry& entry = made[c];
            entry = {(crossing.point - origin_).cast<float>(), direction->second,
                     static_cast<std::uint32_t>(crossing.stands_for), crossing.flat};
            next[column_of(entry.offset)].fetch_add(1, std::memory_order_relaxed);
        }
    });
    crossings.at = nullptr;  // which frees the list behind it, if there is one
    for (std::size_t c = 0; c < columns; ++c) {
        first_[c + 1] = first_[c] + next[c].load(std::memory_order_relaxed);
        next[c].store(0, std::memory_order_relaxed);
    }
    directions_ = directions.all();
    std::sort(directions_.begin(), directions_.end(), [](const auto& a, const auto& b) {
        return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
    });
    std::vector<std::uint32_t> sorted;  // their numbers then
    for (const Eigen::Vector3f& direction : directions.all())
        sorted.push_back(static_cast<std::uint32_t>(
            std::find(directions_.begin(), directions_.end(), direction) - directions_.begin()));
    entries_ = Entries(crossings.size);
    tbb::parallel_for(range_of_all, [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
            const std::size_t column = column_of(made[c].offset);
            Entry& entry = entries_[first_[column] + next[column].fetch_add(1, std::memory_order_relaxed)];
            entry = made[c];
            entry.direction = sorted[entry.direction];
        }
    });
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns, 256), [&](const auto& range) {
        std::vector<Entry> column;  // which may be parts of two blocks
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
            column.clear();
            for (std::size_t e = first_[c]; e < first_[c + 1]; ++e) column.push_back(entries_[e]);
            std::sort(column.begin(), column.end(), [](const Entry& a, const Entry& b) {
                return std::make_tuple(a.offset.z(), a.offset.x(), a.offset.y(), a.direction) <
                       std::make_tuple(b.offset.z(), b.offset.x(), b.offset.y(), b.direction);
            });
            for (std::size_t e = first_[c]; e < first_[c + 1]; ++e) entries_[e] = column[e - first_[c]];
        }
    });
}

CrossingGrid CrossingGrid::some(std::vector<int>& numbers) const {
    CrossingGrid result(spacing_, origin_, size_, numbers.size());
    struct Place {
        std::size_t column;
        float z;
        int number;
    };
    std::vector<Place> places;
    places.reserve(numbers.size());
    for (const int number : numbers) {
        const Eigen::Vector3f& offset = entries_[number].offset;
        places.push_back({result.column_of(offset), offset.z(), number});
        ++result.first_[places.back().column + 1];
    }
    std::partial_sum(result.first_.begin(), result.first_.end(), result.first_.begin());
    tbb::parallel_sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
        return std::tie(a.column, a.z, a.number) < std::tie(b.column, b.z, b.number);
    });
    result.entries_ = Entries(places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
        numbers[i] = places[i].number;
        result.entries_[i] = entries_[places[i].number];
    }
    result.directions_ = directions_;
    return result;
}

}  // namespace isotrack
