#include "meshing/triangle_boxes.h"

#define BOOST_ALLOW_DEPRECATED_HEADERS  // Boost 1.74 includes its own, and the compiler would say so
#include <algorithm>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <boost/iterator/function_output_iterator.hpp>
#include <utility>

#include "meshing/triangle_box.h"
#include "numbers_below.h"

namespace isotrack {
namespace {

using TreePoint = boost::geometry::model::point<double, 3, boost::geometry::cs::cartesian>;
using TreeBox = boost::geometry::model::box<TreePoint>;
using Entry = std::pair<TreeBox, int>;
using Tree = boost::geometry::index::rtree<Entry, boost::geometry::index::quadratic<16>>;

TreeBox to_tree(const Box& box) {
    return {{box.min().x(), box.min().y(), box.min().z()}, {box.max().x(), box.max().y(), box.max().z()}};
}

}  // namespace

/// Boxes of what a triangle was stay in the tree: it is found more often than needed, and looked at as it is.
struct TriangleBoxes::Impl {
    const std::vector<Vec3>& points;
    const std::vector<Triangle>& triangles;
    Tree tree;

    Box box(int triangle) const { return box_of(points, triangles[triangle]); }
};

TriangleBoxes::TriangleBoxes(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                             const std::vector<int>& some)
    : impl_(new Impl{points, triangles, Tree()}) {
    std::vector<Entry> entries;
    entries.reserve(some.size());
    for (const int t : some) entries.emplace_back(to_tree(impl_->box(t)), t);
    impl_->tree = Tree(entries.begin(), entries.end());
}

TriangleBoxes::TriangleBoxes(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles)
    : TriangleBoxes(points, triangles, numbers_below(triangles.size())) {}

TriangleBoxes::~TriangleBoxes() = default;

void TriangleBoxes::note(int changed_triangle) {
    impl_->tree.insert({to_tree(impl_->box(changed_triangle)), changed_triangle});
}

std::vector<int> TriangleBoxes::meeting(const Box& box) const {
    std::vector<int> result;
    const auto take = boost::make_function_output_iterator([&](const Entry& entry) {
        if (impl_->box(entry.second).intersects(box)) result.push_back(entry.second);
    });
    impl_->tree.query(boost::geometry::index::intersects(to_tree(box)), take);
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
}

}  // namespace isotrack
