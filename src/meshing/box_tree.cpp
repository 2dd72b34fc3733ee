#include "meshing/box_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "delaunay/spatial_order.h"
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

/// Those with a flag, in the order of the first of their vertices along Hilbert's curve.
std::vector<int> order_along_curve(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                   const std::vector<char>& some) {
    const auto for_each = [&](const auto& visit) {
        for (std::size_t t = 0; t < triangles.size(); ++t)
            if (some[t]) visit(static_cast<int>(t), triangles[t]);
    };
    std::vector<int> vertices, rank(points.size(), -1);
    for_each([&](int, const Triangle& corners) {
        for (const int v : corners)
            if (rank[v] < 0) {
                rank[v] = 0;
                vertices.push_back(v);
            }
    });
    sort_along_curve(points, vertices);
    for (std::size_t n = 0; n < vertices.size(); ++n) rank[vertices[n]] = static_cast<int>(n);
    const auto first_of = [&](const Triangle& t) { return std::min({rank[t[0]], rank[t[1]], rank[t[2]]}); };
    std::vector<int> end(vertices.size() + 1, 0);  // of those that are placed
    for_each([&](int, const Triangle& corners) { ++end[first_of(corners) + 1]; });
    std::partial_sum(end.begin(), end.end(), end.begin());
    std::vector<int> result(end.back());
    for_each([&](int t, const Triangle& corners) { result[end[first_of(corners)]++] = t; });
    return result;
}

}  // namespace

BoxTree::BoxTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                 const std::vector<char>& some)
    : BoxTree(points, triangles, order_along_curve(points, triangles, some), 1) {}

BoxTree::BoxTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                 const std::vector<int>& order, int run_length) {
    Box bounds;
    for (const Vec3& p : points) bounds.extend(p);
    if (!bounds.isEmpty()) origin_ = bounds.min();

    const auto box_of_run = [&](int run) {
        const std::size_t begin = static_cast<std::size_t>(run) * static_cast<std::size_t>(run_length);
        Box box = box_of(points, triangles[begin]);
        for (std::size_t t = begin + 1; t < std::min(begin + run_length, triangles.size()); ++t)
            box.extend(box_of(points, triangles[t]));
        return box;
    };
    constexpr std::size_t kLeafGrain = 64;
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
                box = rounded(box_of_run(leaf.triangle[m]));
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

std::vector<int> BoxTree::order() const {
    std::vector<int> result;
    for (const Leaf& leaf : leaves_) result.insert(result.end(), leaf.triangle, leaf.triangle + leaf.count);
    return result;
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
