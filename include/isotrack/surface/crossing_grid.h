// The lattice crossings of a surface, found by place.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "isotrack/surface/surface.h"

namespace isotrack {

/// Crossings in columns along the third axis, sorted within each by where they are on it. The order depends
/// on the crossings and the surface's bounds alone. Read-only, so threads may share it.
class CrossingGrid {
public:
    /// Those of `surface.crossing_sequence(apart)`.
    explicit CrossingGrid(const Surface& surface, double apart = 0.0)
        : CrossingGrid(std::max(surface.resolution(), apart), surface.bounds(),
                       surface.crossing_sequence(apart)) {}
    /// `spacing` of the crossings, world units. Few different directions, as those of a lattice: 65 536 at
    /// most. Each crossing is asked for more than once.
    CrossingGrid(Surface::CrossingSequence crossings, double spacing);
    CrossingGrid(std::vector<Surface::Crossing> crossings, double spacing)
        : CrossingGrid(Surface::CrossingSequence(std::move(crossings)), spacing) {}

    std::size_t size() const { return offsets_.size(); }
    bool empty() const { return size() == 0; }
    /// Its point is exact to 1e-7 of the extent of the surface's bounds, or of all crossings where these were
    /// given.
    Surface::Crossing operator[](std::size_t i) const {
        const Kind kind = kinds_[i];
        return {origin_ + offsets_[i].cast<double>(), directions_[kind.direction],
                static_cast<std::int16_t>(kind.stands_for), kind.flat != 0};
    }
    double spacing() const { return spacing_; }
    /// Whether some of a surface's crossings stand for all.
    bool thinned_out(const Surface& surface) const { return spacing_ >= 2.0 * surface.resolution(); }

    /// Some of them alone, found by place: the one with index i is that with index `numbers[i]` here. To that
    /// end `numbers`, all below `size()`, are put into another order.
    CrossingGrid some(std::vector<int>& numbers) const;

    /// Calls `visit` with the index of every crossing in `box`.
    template <typename Visit>
    void for_each_in(const Box& box, const Visit& visit) const {
        if (empty()) return;
        const Vec3 low = box.min() - origin_, high = box.max() - origin_;
        const int to[2] = {column(0, high.x()), column(1, high.y())};
        for (int x = column(0, low.x()); x <= to[0]; ++x)
            for (int y = column(1, low.y()); y <= to[1]; ++y) {
                const std::size_t at = static_cast<std::size_t>(x) * count_[1] + y;
                offsets_.for_each_run(first_[at], first_[at + 1],
                                      [&](const Offset* begin, const Offset* end, std::size_t first) {
                                          const Offset* o = std::lower_bound(
                                              begin, end, low.z(),
                                              [](const Offset& offset, double z) { return offset.z() < z; });
                                          for (; o != end && o->z() <= high.z(); ++o)
                                              if (o->x() >= low.x() && o->x() <= high.x() &&
                                                  o->y() >= low.y() && o->y() <= high.y())
                                                  visit(first + static_cast<std::size_t>(o - begin));
                                      });
            }
    }

private:
    /// `box`: around them.
    CrossingGrid(double spacing, const Box& box, Surface::CrossingSequence crossings);
    /// Without crossings, for so many.
    CrossingGrid(double spacing, const Vec3& origin, const Vec3& size, std::size_t crossings);

    using Offset = Eigen::Vector3f;  // from origin_
    /// Many of them, in blocks, which fit into holes of the heap.
    class Offsets {
    public:
        Offsets() = default;
        explicit Offsets(std::size_t size) : size_(size) {
            for (std::size_t begin = 0; begin < size; begin += kBlock)
                blocks_.emplace_back(std::min(kBlock, size - begin));
        }
        std::size_t size() const { return size_; }
        Offset& operator[](std::size_t i) { return blocks_[i / kBlock][i % kBlock]; }
        const Offset& operator[](std::size_t i) const { return blocks_[i / kBlock][i % kBlock]; }
        /// Calls `visit(begin, end, first)` with those from `first` on that are in one block.
        template <typename Visit>
        void for_each_run(std::size_t first, std::size_t end, const Visit& visit) const {
            for (std::size_t next; first < end; first = next) {
                next = std::min(end, (first / kBlock + 1) * kBlock);
                const Offset* begin = &(*this)[first];
                visit(begin, begin + (next - first), first);
            }
        }

        static constexpr std::size_t kBlock = 4096;

    private:
        std::vector<std::vector<Offset>> blocks_;
        std::size_t size_ = 0;
    };
    /// What there is to a crossing besides where it is.
    struct Kind {
        std::uint32_t direction : 16;  // number among directions_
        std::uint32_t stands_for : 15, flat : 1;
    };
    /// Of many crossings, in a byte each where that is enough: there are more of them than of all else.
    class Kinds {
    public:
        Kinds() = default;
        static constexpr std::size_t kMostInShort = 256;  // directions
        /// `short_form`: all stand for themselves alone, none is flat, and there are no more directions.
        Kinds(std::size_t size, bool short_form)
            : direction_(short_form ? size : 0), whole_(short_form ? 0 : size) {}
        Kind operator[](std::size_t i) const {
            return whole_.empty() ? Kind{direction_[i], 1, 0} : whole_[i];
        }
        void set(std::size_t i, const Kind& kind) {
            if (whole_.empty())
                direction_[i] = static_cast<std::uint8_t>(kind.direction);
            else
                whole_[i] = kind;
        }
        bool has_short_form() const { return whole_.empty(); }

    private:
        std::vector<std::uint8_t> direction_;
        std::vector<Kind> whole_;
    };
    int column(int axis, double offset) const {
        return static_cast<int>(std::clamp(offset / width_, 0.0, static_cast<double>(count_[axis] - 1)));
    }
    std::size_t column_of(const Offset& offset) const {
        return static_cast<std::size_t>(column(0, offset.x())) * count_[1] + column(1, offset.y());
    }

    Offsets offsets_;
    Kinds kinds_;
    std::vector<Eigen::Vector3f> directions_;  // those of a lattice: few
    std::vector<std::uint32_t> first_;         // of each column, and the end
    Vec3 origin_, size_;                       // of the box around them
    double spacing_, width_;  // of the columns: wider where there would be many more than crossings
    int count_[2] = {1, 1};
};

}  // namespace isotrack
