// The unit sphere as a grid, and what a level set made of it must be like.
#pragma once

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <random>

#include "isotrack/surface/level_set.h"
#include "support/unit_sphere.h"

namespace isotrack::support {

/// Calls set(coord, signed distance in world units) for the voxels of a box around the unit sphere under
/// `transform`.
template <typename GridType>
typename GridType::Ptr sphere_grid(const openvdb::math::Transform::Ptr& transform, double band,
                                   double unit = 1.0) {
    using Value = typename GridType::ValueType;
    auto grid = GridType::create(static_cast<Value>(band * unit));
    grid->setTransform(transform);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    openvdb::CoordBBox box;
    for (int i = 0; i < 8; ++i) {
        const openvdb::Vec3d corner(i & 1 ? 1.5 : -1.5, i & 2 ? 1.5 : -1.5, i & 4 ? 1.5 : -1.5);
        box.expand(openvdb::Coord::round(transform->worldToIndex(corner)));
    }
    auto accessor = grid->getAccessor();
    for (auto c = box.begin(); c; ++c) {
        const double d = transform->indexToWorld(*c).length() - 1.0;
        if (std::abs(d) < band)
            accessor.setValue(*c, static_cast<Value>(d * unit));
        else if (d < 0.0)
            accessor.setValueOff(*c, static_cast<Value>(-band * unit));
    }
    return grid;
}

inline openvdb::math::Transform::Ptr uniform(double voxel) {
    return openvdb::math::Transform::createLinearTransform(voxel);
}

/// Holds a level set against the unit sphere. `h`: the longest voxel edge. A trilinear interpolant of a
/// distance whose curvature is at most 1 / 0.8 is off by at most 3 / 8 h^2 / 0.8 (one h^2 / 8 per axis).
inline void expect_unit_sphere(const LevelSet& level_set, double h) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    constexpr double kInf = std::numeric_limits<double>::infinity();
    ASSERT_FALSE(level_set.empty());
    const double bound = 0.5 * h * h + 1e-4 * h;
    const auto probe = level_set.probe();
    for (const Vec3& p : near_sphere(2000, 0.8 * h)) {
        const auto s = probe->sample(p);
        ASSERT_NEAR(s.value, p.norm() - 1.0, bound);
        ASSERT_NEAR(probe->value(p), s.value, 1e-6);
        ASSERT_LT((s.gradient - p.normalized()).norm(), 2.0 * h * h + 1e-3) << s.gradient.transpose();
        const auto q = probe->project(p);
        ASSERT_TRUE(q);
        ASSERT_NEAR(q->norm(), 1.0, bound);
        ASSERT_LT((probe->normal(*q) - q->normalized()).norm(), 2.0 * h * h + 1e-3);
        ASSERT_LT((*q - p.normalized()).norm(), 0.1 * h);
    }
    // Signs, near and far.
    std::mt19937 random(3);
    std::uniform_real_distribution<double> coordinate(-3.0, 3.0);
    for (int i = 0; i < 2000; ++i) {
        const Vec3 p(coordinate(random), coordinate(random), coordinate(random));
        if (std::abs(p.norm() - 1.0) < h) continue;
        ASSERT_EQ(probe->value(p) < 0.0, p.norm() < 1.0) << p.transpose();
    }
    EXPECT_LT(probe->value(Vec3::Zero()), 0.0);
    for (const Vec3& far :
         {Vec3(1e6, 0, 0), Vec3(-1e30, 2, 3), Vec3(0, 1e300, 0), Vec3(kNaN, 0, 0), Vec3(kInf, 0, -kInf)})
        EXPECT_GT(probe->value(far), 0.0);
    EXPECT_FALSE(probe->project({kNaN, 0, 0}));
    EXPECT_FALSE(probe->project({100, 0, 0}));
    EXPECT_TRUE(probe->normal({100, 0, 0}).isZero());

    const auto crossings = level_set.crossings();
    EXPECT_EQ(crossings.size(), level_set.crossing_count());
    for (const auto& c : crossings) {
        ASSERT_NEAR(c.point.norm(), 1.0, h * h);
        ASSERT_NEAR(c.outward.norm(), 1.0f, 1e-5f);
        ASSERT_GT(c.outward.cast<double>().dot(c.point.normalized()), -1.5 * h);
    }
    const Box box = level_set.bounds();
    EXPECT_LT((box.min() + Vec3::Ones()).norm(), 2.0 * h);
    EXPECT_LT((box.max() - Vec3::Ones()).norm(), 2.0 * h);
}

}  // namespace isotrack::support
