// Crossings that stand for others, and those others.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
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
        if (cube == 2) {
            EXPECT_GT(flat, 0u);  // the ball is too round for more
        }
        // Of the plate both sides are seen.
        for (const double side : {-1.0, 1.0})
            EXPECT_TRUE(std::any_of(some.begin(), some.end(), [&](const Surface::Crossing& c) {
                return (c.point - Vec3(0.01, 1.5 + side * h, 0.01)).norm() < 1.5 * cube * h &&
                       c.outward.y() * side > 0.5;
            }));
    }
}

/// Of points, across the direction in which they vary least.
double thickness(const std::vector<Vec3>& points) {
    Vec3 mean = Vec3::Zero();
    for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
    Mat3 covariance = Mat3::Zero();
    for (const Vec3& p : points) covariance += (p - mean) * (p - mean).transpose();
    const Vec3 across = Eigen::SelfAdjointEigenSolver<Mat3>(covariance).eigenvectors().col(0);
    double low = 0.0, high = 0.0;
    for (const Vec3& p : points) {
        low = std::min(low, across.dot(p - mean));
        high = std::max(high, across.dot(p - mean));
    }
    return high - low;
}

TEST(LevelSet, LetsFourCrossingsStandForAFlatSheet) {
    const double h = 0.02;
    Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
    turn.rotate(Eigen::AngleAxisd(0.4, Vec3(1.0, 2.0, 0.5).normalized()));
    const auto slab = shapes::moved(shapes::box({0, 0, 0}, {60.0 * h, 60.0 * h, 15.0 * h}, h), turn);
    // A ball is as flat in small cubes, and is not in large ones.
    const auto shape = shapes::unite({slab, shapes::sphere({0, 0, 3.0}, 30.0 * h, h)});
    const LevelSet level_set(rasterise(*shape, h));
    for (const int cube : {2, 4, 8}) {
        const int wide = 4 * cube;
        const auto cube_of = [&](const Surface::Crossing& c) {
            const Vec3 at = (c.point / (wide * h)).array().floor();
            return std::array{at.x(), at.y(), at.z()};
        };
        // Whose those within a voxel of their border are is not said.
        const auto is_within = [&](const Surface::Crossing& c) {
            const Vec3 in_cube = c.point / h - wide * (c.point / (wide * h)).array().floor().matrix();
            return in_cube.minCoeff() >= 1.0 && in_cube.maxCoeff() <= wide - 1.0;
        };
        std::map<std::array<double, 3>, int> flat_ones;
        for (const auto& c : level_set.crossings(1.001 * cube * h))
            if (c.flat && is_within(c)) ++flat_ones[cube_of(c)];
        EXPECT_GT(flat_ones.size(), 2000u / (wide * wide));
        std::map<std::array<double, 3>, std::vector<Vec3>> all_of;
        for (const auto& c : level_set.crossings())
            if (is_within(c) && flat_ones.count(cube_of(c)) > 0) all_of[cube_of(c)].push_back(c.point);
        for (const auto& [at, count] : flat_ones) {
            EXPECT_LE(count, 4);
            EXPECT_LT(thickness(all_of[at]), 0.2 * wide * h);  // 0.16 between the best planes
        }
    }
}

}  // namespace
}  // namespace isotrack
