#include "meshing/triangle_bins.h"

#include <algorithm>
#include <atomic>
#include <cstddef>

#include "parallel_for_each.h"

namespace isotrack {

TriangleBins::TriangleBins(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                           double size)
    : points_(points), triangles_(triangles), size_(size) {
    constexpr double kMostCubes = 8.0, kSome = 1000.0;  // for each triangle; in any case
    struct Extent {
        Box bounds;
        double sum = 0.0;
    };
    // In blocks, so that the sum does not depend on the number of threads.
    constexpr std::size_t kBlock = 4096;
    std::vector<Extent> extents((triangles.size() + kBlock - 1) / kBlock);
    parallel_for_each(extents.size(), 1, [&](std::size_t b) {
        for (std::size_t t = b * kBlock; t < std::min(triangles.size(), (b + 1) * kBlock); ++t) {
            const Box box = box_of(static_cast<int>(t));
            extents[b].bounds.extend(box);
            extents[b].sum += box.sizes().maxCoeff();
        }
    });
    Extent all;
    for (const Extent& extent : extents) {
        all.bounds.extend(extent.bounds);
        all.sum += extent.sum;
    }
    if (!triangles.empty()) {
        low_ = all.bounds.min();
        size_ = std::max(size_, 0.5 * all.sum / static_cast<double>(triangles.size()));
        const auto counts = [&] { return (all.bounds.sizes() / size_).array().floor() + 1.0; };
        while (counts().prod() > kMostCubes * static_cast<double>(triangles.size()) + kSome) size_ *= 1.25;
        count_ = counts().cast<int>();
    }
    const auto cubes = static_cast<std::size_t>(count_.prod());
    std::vector<std::atomic<int>> next(cubes);  // how many, then where the next one goes
    const auto for_each_cube = [&](const auto& visit) {
        parallel_for_each(triangles.size(), kBlock, [&](std::size_t t) {
            const Range range = range_of(box_of(static_cast<int>(t)));
            for (int x = range.from.x(); x <= range.to.x(); ++x)
                for (int y = range.from.y(); y <= range.to.y(); ++y)
                    for (int z = range.from.z(); z <= range.to.z(); ++z)
                        visit(static_cast<int>(t), number(x, y, z));
        });
    };
    for_each_cube([&](int, std::size_t cube) { next[cube].fetch_add(1, std::memory_order_relaxed); });
    first_.assign(cubes + 1, 0);
    for (std::size_t cube = 0; cube < cubes; ++cube)
        first_[cube + 1] = first_[cube] + next[cube].exchange(first_[cube], std::memory_order_relaxed);
    members_.resize(first_.back());
    for_each_cube(
        [&](int t, std::size_t cube) { members_[next[cube].fetch_add(1, std::memory_order_relaxed)] = t; });
}

std::vector<int> TriangleBins::meeting(const Box& box) const {
    std::vector<int> result;
    const Range range = range_of(box);
    for (int x = range.from.x(); x <= range.to.x(); ++x)
        for (int y = range.from.y(); y <= range.to.y(); ++y)
            for (int z = range.from.z(); z <= range.to.z(); ++z) {
                const std::size_t cube = number(x, y, z);
                for (int m = first_[cube]; m < first_[cube + 1]; ++m)
                    if (box_of(members_[m]).intersects(box)) result.push_back(members_[m]);
            }
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
}

TriangleBins::Range TriangleBins::range_of(const Box& box) const {
    // What is not below 0 is rounded down by being made a whole number; floor is a call for each.
    const auto cube_at = [&](const Vec3& p) -> Eigen::Array3i {
        const Eigen::Array3d at = (p - low_).array() / size_;
        return at.max(0.0).min((count_ - 1).cast<double>()).cast<int>();
    };
    return {cube_at(box.min()), cube_at(box.max())};
}

}  // namespace isotrack
