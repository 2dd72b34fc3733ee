#include "meshing/box_tree.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshing/triangle_box.h"
#include "parallel_for_each.h"

namespace isotrack {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();

float rounded_down(double x) {
    const auto nearest = static_cast<float>(x);
    return nearest > x ? std::nextafter(nearest, -kInfinite) : nearest;
}

float rounded_up(double x) {
    return -rounded_down(-x);
}

constexpr int kMostBits = 21;  // of a coordinate

/// With two zero bits behind each of the lowest 21.
std::uint64_t spread(std::uint64_t x) {
    x = (x | x << 32) & 0x1f00000000ffff;
    x = (x | x << 16) & 0x1f0000ff0000ff;
    x = (x | x << 8) & 0x100f00f00f00f00f;
    x = (x | x << 4) & 0x10c30c30c30c30c3;
    return (x | x << 2) & 0x1249249249249249;
}

/// Sorts numbers of places along Morton's curve in `bounds`, and where many are in one cell of the curve once
/// more along the curve in theirs. `place`: of a number.
template <typename Place>
void sort_along_morton(std::vector<int>::iterator begin, std::vector<int>::iterator end, const Box& bounds,
                       const Place& place) {
    constexpr std::size_t kMany = 256, kGrain = 1024;
    const auto count = static_cast<std::size_t>(end - begin);
    const double size = bounds.isEmpty() ? 0.0 : bounds.sizes().maxCoeff();
    if (count < 2 || !(size > 0.0) || !std::isfinite(size)) return;
    // The key of a cell, with as many bits as there is room for, before where a number was.
    int behind = 0;
    while (count >> behind != 0) ++behind;
    const int bits = std::min(kMostBits, (64 - behind) / 3);
    const double most = static_cast<double>((std::uint64_t{1} << bits) - 1), scale = most / size;
    std::vector<std::uint64_t> keys(count);
    parallel_for_each(count, kGrain, [&](std::size_t i) {
        const Vec3 p = place(begin[static_cast<std::ptrdiff_t>(i)]);
        for (int axis = 0; axis < 3; ++axis) {
            const double at = (p[axis] - bounds.min()[axis]) * scale;
            if (at > 0.0) keys[i] |= spread(static_cast<std::uint64_t>(std::min(at, most))) << axis;
        }
        keys[i] = keys[i] << behind | i;
    });
    tbb::parallel_sort(keys.begin(), keys.end());
    const std::vector<int> before(begin, end);
    for (std::size_t i = 0; i < count; ++i)
        begin[static_cast<std::ptrdiff_t>(i)] = before[keys[i] & ((std::uint64_t{1} << behind) - 1)];
    for (std::size_t first = 0, last = 0; first < count; first = last) {
        while (last < count && keys[last] >> behind == keys[first] >> behind) ++last;
        if (last - first < kMany) continue;
        const auto from = begin + static_cast<std::ptrdiff_t>(first),
                   to = begin + static_cast<std::ptrdiff_t>(last);
        Box cell;
        std::for_each(from, to, [&](int number) { cell.extend(place(number)); });
        sort_along_morton(from, to, cell, place);
    }
}

}  // namespace

BoxTree::BoxTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                 const std::vector<char>& some) {
    Box bounds;
    for (const Vec3& p : points) bounds.extend(p);
    if (!bounds.isEmpty()) origin_ = bounds.min();

    constexpr std::size_t kLeafGrain = 64;
    std::vector<int> order;
    order.reserve(triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t)
        if (some[t]) order.push_back(static_cast<int>(t));
    sort_along_morton(order.begin(), order.end(), bounds,
                      [&](int t) -> Vec3 { return box_of(points, triangles[t]).center(); });

    leaves_.resize((order.size() + kPerLeaf - 1) / kPerLeaf);
    while (first_ < leaves_.size()) first_ *= 2, ++levels_;
    const Bounds empty{{kInfinite, kInfinite, kInfinite}, {-kInfinite, -kInfinite, -kInfinite}};
    bounds_.assign(2 * first_, empty);
    parallel_for_each(leaves_.size(), kLeafGrain, [&](std::size_t l) {
        Leaf& leaf = leaves_[l];
        const std::size_t begin = l * kPerLeaf;
        leaf.count = static_cast<int>(std::min<std::size_t>(kPerLeaf, order.size() - begin));
        for (int m = 0; m < kPerLeaf; ++m) {
            Bounds box = empty;
            if (m < leaf.count) {
                leaf.triangle[m] = order[begin + m];
                box = rounded(box_of(points, triangles[leaf.triangle[m]]));
            }
            Bounds& all = bounds_[first_ + l];
            for (int axis = 0; axis < 3; ++axis) {
                leaf.low[axis][m] = box.low[axis];
                leaf.high[axis][m] = box.high[axis];
                all.low[axis] = std::min(all.low[axis], box.low[axis]);
                all.high[axis] = std::max(all.high[axis], box.high[axis]);
            }
        }
    });
    for (std::size_t node = first_ - 1; node > 0; --node)
        for (int axis = 0; axis < 3; ++axis) {
            const Bounds &one = bounds_[2 * node], &other = bounds_[2 * node + 1];
            bounds_[node].low[axis] = std::min(one.low[axis], other.low[axis]);
            bounds_[node].high[axis] = std::max(one.high[axis], other.high[axis]);
        }
}

BoxTree::Bounds BoxTree::rounded(const Box& box) const {
    Bounds result;
    for (int axis = 0; axis < 3; ++axis) {
        result.low[axis] = rounded_down(box.min()[axis] - origin_[axis]);
        result.high[axis] = rounded_up(box.max()[axis] - origin_[axis]);
    }
    return result;
}

}  // namespace isotrack
