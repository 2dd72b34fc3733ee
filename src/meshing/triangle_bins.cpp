#include "meshing/triangle_bins.h"

namespace isotrack {

TriangleBins::TriangleBins(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                           double size)
    : points_(points), triangles_(triangles), size_(size) {
    constexpr double kMostCubes = 8.0, kSome = 1000.0;  // for each triangle; in any case
    Box bounds;
    double sum = 0.0;
    for (int t = 0; t < static_cast<int>(triangles.size()); ++t) {
        bounds.extend(box_of(t));
        sum += box_of(t).sizes().maxCoeff();
    }
    if (!triangles.empty()) {
        low_ = bounds.min();
        size_ = std::max(size_, 0.5 * sum / static_cast<double>(triangles.size()));
        const auto counts = [&] { return (bounds.sizes() / size_).array().floor() + 1.0; };
        while (counts().prod() > kMostCubes * static_cast<double>(triangles.size()) + kSome) size_ *= 1.25;
        count_ = counts().cast<int>();
    }
    first_.assign(static_cast<std::size_t>(count_.prod()) + 1, 0);
    const auto for_each_cube = [&](int t, const auto& visit) {
        const Range range = range_of(box_of(t));
        for (int x = range.from.x(); x <= range.to.x(); ++x)
            for (int y = range.from.y(); y <= range.to.y(); ++y)
                for (int z = range.from.z(); z <= range.to.z(); ++z) visit(number(x, y, z));
    };
    for (int t = 0; t < static_cast<int>(triangles.size()); ++t)
        for_each_cube(t, [&](std::size_t cube) { ++first_[cube]; });
    int members = 0;
    for (int& first : first_) first = members += first;  // the ends, from which they are filled
    members_.resize(members);
    for (int t = static_cast<int>(triangles.size()) - 1; t >= 0; --t)
        for_each_cube(t, [&](std::size_t cube) { members_[--first_[cube]] = t; });
}

std::vector<int> TriangleBins::meeting(const Box& box) const {
    std::vector<int> result;
    for_each_in(range_of(box), [&](int t) {
        if (box_of(t).intersects(box)) result.push_back(t);
    });
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
}

bool TriangleBins::any_meets(const Box& box) const {
    return any_in(range_of(box), [&](int t) { return box_of(t).intersects(box); });
}

TriangleBins::Range TriangleBins::range_of(const Box& box) const {
    const auto cube_at = [&](const Vec3& p) -> Eigen::Array3i {
        const Eigen::Array3d at = ((p - low_) / size_).array().floor();
        return at.max(0.0).min((count_ - 1).cast<double>()).cast<int>();
    };
    return {cube_at(box.min()), cube_at(box.max())};
}

}  // namespace isotrack
