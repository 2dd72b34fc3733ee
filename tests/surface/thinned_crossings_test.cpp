// Crossings that stand for others, and those others.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

TEST(LevelSet, GivesAllCrossingsNearPlaces) {
    const double h = 0.02;
    const LevelSet level_set(rasterise(*shapes::torus({0.1, 0, 0}, 0.5, 0.21, h), h));
    const auto all = level_set.crossings();
    const auto is_less = [](const Vec3& a, const Vec3& b) {
        return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
    };
    for (const double reach : {0.4 * h, 1.0 * h, 3.7 * h}) {
        const std::vector<Vec3> places = {all[7].point, all[all.size() / 3].point, Vec3(9, 9, 9)};
        std::set<Vec3, decltype(is_less)> near(is_less);
        for (const auto& crossing : level_set.crossings_near(places, reach))
            EXPECT_TRUE(near.insert(crossing.point).second) << "twice";
        EXPECT_LT(near.size(), all.size() / 20);
        std::size_t wanted = 0;
        for (const auto& crossing : all)
            for (const Vec3& place : places)
                if ((crossing.point - place).cwiseAbs().maxCoeff() <= reach) {
                    EXPECT_EQ(near.count(crossing.point), 1u);
                    ++wanted;
                }
        EXPECT_GE(wanted, 2u);
    }
    EXPECT_TRUE(level_set.crossings_near({}, h).empty());
}

TEST(LevelSet, LetsACrossingStandForOthersInACube) {
    const double h = 0.02;
    // A ball, a drop of three voxels between the lines of a coarse lattice, and a plate of two.
    const auto shape =
        shapes::unite({shapes::sphere({0, 0, 0}, 0.6, h), shapes::sphere({1.013, 0.02, 0.51}, 1.5 * h, h),
                       shapes::box({0, 1.5, 0}, {0.5, h, 0.4}, h)});
    const LevelSet level_set(rasterise(*shape, h));
    const auto all = level_set.crossings();
    EXPECT_EQ(level_set.crossings(1.99 * h).size(), all.size());
    for (const int cube : {2, 4, 8}) {
        const auto some = level_set.crossings(1.001 * cube * h);
        EXPECT_LT(some.size(), 1.7 * static_cast<double>(all.size()) / (cube * cube));
        for (const auto& c : all) {
            // One axis-parallel cube holds both, a voxel added for the lengths of the edges.
            const bool stands_for =
                std::any_of(some.begin(), some.end(), [&](const Surface::Crossing& other) {
                    const int edge = other.flat ? 4 * cube : cube;
                    return (other.point - c.point).cwiseAbs().maxCoeff() <= (edge + 1) * h;
                });
            ASSERT_TRUE(stands_for) << c.point.transpose();
        }
        std::size_t stood_for = 0, flat = 0;
        for (const auto& c : some) {
            stood_for += static_cast<std::size_t>(c.stands_for);
            if (!c.flat) continue;
            ++flat;
            EXPECT_GT((c.point - Vec3(1.013, 0.02, 0.51)).norm(), 2.0 * h) << "a drop is not flat";
        }
        EXPECT_EQ(stood_for, all.size());
        EXPECT_TRUE(flat > 0 || cube > 2);  // the ball is too round for more
        // Of the plate both sides are seen.
        for (const double side : {-1.0, 1.0})
            EXPECT_TRUE(std::any_of(some.begin(), some.end(), [&](const Surface::Crossing& c) {
                return (c.point - Vec3(0.01, 1.5 + side * h, 0.01)).norm() < 1.5 * cube * h &&
                       c.outward.y() * side > 0.5;
            }));
    }
}

}  // namespace
}  // namespace isotrack
