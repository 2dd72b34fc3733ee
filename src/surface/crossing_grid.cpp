#include "isotrack/surface/crossing_grid.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <atomic>
#include <cassert>
#include <cmath>
#include <mutex>
#include <numeric>
#include <tuple>
#include <utility>

namespace isotrack {

namespace {

/// Different directions, found by several threads.
class Directions {
public:
    void add(const Eigen::Vector3f& direction) {
        const std::lock_guard lock(mutex_);
        if (std::find(all_.begin(), all_.end(), direction) == all_.end()) all_.push_back(direction);
    }
    std::vector<Eigen::Vector3f> take_sorted() {
        std::sort(all_.begin(), all_.end(), [](const auto& a, const auto& b) {
            return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
        });
        return std::move(all_);
    }

private:
    std::mutex mutex_;
    std::vector<Eigen::Vector3f> all_;
};

Box box_around(const Surface::CrossingSequence& crossings) {
    Box box;
    crossings.for_each_in(0, crossings.size, [&](const Surface::Crossing& c) { box.extend(c.point); });
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
    const auto offset_of = [&](const Surface::Crossing& crossing) -> Offset {
        return (crossing.point - origin_).cast<float>();
    };
    // They are made to be counted, and again to be put in their place: held twice they would take more memory
    // than anything that a frame needs later.
    std::vector<std::atomic<std::uint32_t>> next(columns);
    Directions directions;
    std::atomic<bool> all_alone = true;
    const auto range_of_all = tbb::blocked_range<std::size_t>(0, crossings.size, Offsets::kBlock);
    tbb::parallel_for(range_of_all, [&](const auto& range) {
        std::vector<Eigen::Vector3f> known;
        crossings.for_each_in(range.begin(), range.end(), [&](const Surface::Crossing& crossing) {
            if (std::find(known.begin(), known.end(), crossing.outward) == known.end())
                directions.add(known.emplace_back(crossing.outward));
            if (crossing.stands_for != 1 || crossing.flat) all_alone.store(false, std::memory_order_relaxed);
            next[column_of(offset_of(crossing))].fetch_add(1, std::memory_order_relaxed);
        });
    });
    for (std::size_t c = 0; c < columns; ++c) {
        first_[c + 1] = first_[c] + next[c].load(std::memory_order_relaxed);
        next[c].store(first_[c], std::memory_order_relaxed);
    }
    // Each goes to the next free place of its column, in any order: they are sorted then.
    directions_ = directions.take_sorted();
    offsets_ = Offsets(crossings.size);
    kinds_ = Kinds(crossings.size, all_alone && directions_.size() <= Kinds::kMostInShort);
    tbb::parallel_for(range_of_all, [&](const auto& range) {
        crossings.for_each_in(range.begin(), range.end(), [&](const Surface::Crossing& crossing) {
            const Offset offset = offset_of(crossing);
            const std::uint32_t at = next[column_of(offset)].fetch_add(1, std::memory_order_relaxed);
            const auto direction = std::find(directions_.begin(), directions_.end(), crossing.outward);
            assert(at < crossings.size && direction != directions_.end());
            offsets_[at] = offset;
            kinds_.set(at, {static_cast<std::uint32_t>(direction - directions_.begin()),
                            static_cast<std::uint32_t>(crossing.stands_for), crossing.flat});
        });
    });
    crossings.write = nullptr;  // which frees the list behind it, if there is one
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns, 256), [&](const auto& range) {
        struct Placed {
            Offset offset;
            Kind kind;
        };
        std::vector<Placed> column;  // which may be parts of two blocks
        const auto key = [](const Placed& p) {
            return std::make_tuple(p.offset.z(), p.offset.x(), p.offset.y(), std::uint32_t{p.kind.direction});
        };
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
            column.clear();
            for (std::size_t i = first_[c]; i < first_[c + 1]; ++i)
                column.push_back({offsets_[i], kinds_[i]});
            std::sort(column.begin(), column.end(),
                      [&](const Placed& a, const Placed& b) { return key(a) < key(b); });
            for (std::size_t i = first_[c]; i < first_[c + 1]; ++i) {
                offsets_[i] = column[i - first_[c]].offset;
                kinds_.set(i, column[i - first_[c]].kind);
            }
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
        const Offset& offset = offsets_[number];
        places.push_back({result.column_of(offset), offset.z(), number});
        ++result.first_[places.back().column + 1];
    }
    std::partial_sum(result.first_.begin(), result.first_.end(), result.first_.begin());
    tbb::parallel_sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
        return std::tie(a.column, a.z, a.number) < std::tie(b.column, b.z, b.number);
    });
    result.offsets_ = Offsets(places.size());
    result.kinds_ = Kinds(places.size(), kinds_.has_short_form());
    for (std::size_t i = 0; i < places.size(); ++i) {
        numbers[i] = places[i].number;
        result.offsets_[i] = offsets_[places[i].number];
        result.kinds_.set(i, kinds_[places[i].number]);
    }
    result.directions_ = directions_;
    return result;
}

}  // namespace isotrack
