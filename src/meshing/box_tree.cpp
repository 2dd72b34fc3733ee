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

/// Numbers of triangles behind their places on Morton's curve, with as many bits as there is room for.
class CurveKeys {
public:
    CurveKeys(const Box& bounds, std::size_t triangles) : low_(bounds.min()) {
        while (number_bits_ < 32 && triangles >> number_bits_ != 0) ++number_bits_;
        const int bits = std::min(kMostBits, (64 - number_bits_) / 3);
        most_ = static_cast<double>((std::uint64_t{1} << bits) - 1);
        for (int axis = 0; axis < 3; ++axis) {
            const double size = bounds.isEmpty() ? 0.0 : bounds.sizes()[axis];
            scale_[axis] = size > 0.0 ? most_ / size : 0.0;
        }
    }
    std::uint64_t of(const Vec3& place, std::size_t triangle) const {
        std::uint64_t key = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const double at = (place[axis] - low_[axis]) * scale_[axis];
            if (at > 0.0) key |= spread(static_cast<std::uint64_t>(std::min(at, most_))) << axis;
        }
        return key << number_bits_ | triangle;
    }
    int triangle_of(std::uint64_t key) const {
        return static_cast<int>(key & ((std::uint64_t{1} << number_bits_) - 1));
    }

private:
    Vec3 low_, scale_;
    double most_;
    int number_bits_ = 0;
};

}  // namespace

BoxTree::BoxTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                 const std::vector<char>& some) {
    Box bounds;
    for (const Vec3& p : points) bounds.extend(p);
    if (!bounds.isEmpty()) origin_ = bounds.min();

    constexpr std::size_t kTriangleGrain = 1024, kLeafGrain = 64;
    constexpr std::uint64_t kNone = ~std::uint64_t{0};
    const CurveKeys keys(bounds, triangles.size());
    std::vector<std::uint64_t> order(triangles.size());
    parallel_for_each(triangles.size(), kTriangleGrain, [&](std::size_t t) {
        const Box box = box_of(points, triangles[t]);
        order[t] = some[t] ? keys.of(box.center(), t) : kNone;
    });
    tbb::parallel_sort(order.begin(), order.end());
    order.resize(
        static_cast<std::size_t>(std::lower_bound(order.begin(), order.end(), kNone) - order.begin()));

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
                leaf.triangle[m] = keys.triangle_of(order[begin + m]);
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
