#include "meshing/triangle_tree.h"

#include <cassert>
#include <cstddef>
#include <numeric>

#include "numbers_below.h"

namespace isotrack {
namespace {

/// The order of a tree for what became of its mesh.
std::vector<int> order_after(const BoxTree& before, const std::vector<int>& gone, std::size_t count) {
    std::vector<int> order = before.order();
    std::vector<int> number(order.size(), 1);  // of each triangle that was there; -1: gone
    for (const int t : gone) number[t] = 0;
    int kept = 0;
    for (int& n : number) n = n != 0 ? kept++ : -1;
    for (int& t : order) t = number[t];
    order.erase(std::remove(order.begin(), order.end(), -1), order.end());
    assert(order.size() <= count);
    order.resize(count);
    std::iota(order.begin() + kept, order.end(), kept);
    return order;
}

}  // namespace

TriangleTree::TriangleTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                           const std::vector<int>& order, int run_length)
    : points_(points),
      triangles_(triangles),
      run_length_(run_length),
      boxes_(points, triangles, order, run_length) {}

TriangleTree::TriangleTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles)
    : points_(points),
      triangles_(triangles),
      run_length_(1),
      boxes_(points, triangles, std::vector<char>(triangles.size(), 1)) {}

TriangleTree::TriangleTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                           const TriangleTree& before, const std::vector<int>& gone)
    : TriangleTree(points, triangles, order_after(before.boxes_, gone, triangles.size()), 1) {
    assert(before.run_length_ == 1);
}

TriangleTree TriangleTree::in_order(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
    constexpr int kRunLength = 8;  // as many as a lattice mesh has of one crossed edge
    return {points, triangles, numbers_below((triangles.size() + kRunLength - 1) / kRunLength), kRunLength};
}

std::vector<int> TriangleTree::meeting(const Box& box) const {
    std::vector<int> result;
    for_each_near(box, [&](int t) {
        if (box_of(t).intersects(box)) result.push_back(t);
    });
    if (!std::is_sorted(result.begin(), result.end())) std::sort(result.begin(), result.end());
    return result;
}

}  // namespace isotrack
