// The place that is found is the nearest of all in position and normal.
#include "tracking/oriented_places.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

TEST(OrientedPlaces, FindsTheNearestInPlaceAndNormal) {
    constexpr double kTurnLength = 0.4;
    const auto solid =
        shapes::unite({shapes::torus({0, 0, 0}, 0.8, 0.25, 0.05), shapes::sphere({0, 0, 0.8}, 0.3, 0.05)});
    const CrossingGrid crossings(*solid);
    ASSERT_LT(crossings.size(), 10000u);
    const OrientedPlaces places(*solid, crossings, kTurnLength);
    ASSERT_FALSE(places.empty());
    const auto probe = solid->probe();
    std::mt19937 random(1);
    std::normal_distribution<double> some;
    const auto distance2 = [&](const Vec3& p, const Vec3& n, const Vec3& q, const Vec3& m) {
        return (p - q).squaredNorm() + 0.5 * kTurnLength * kTurnLength * (n - m).squaredNorm();
    };
    for (int k = 0; k < 200; ++k) {
        const Vec3 p(some(random), some(random), 0.5 * some(random));
        const Vec3 n = Vec3(some(random), some(random), some(random)).normalized();
        const auto& [point, normal] = places.nearest(p, n);
        EXPECT_NEAR((normal - probe->normal(point)).norm(), 0.0, 1e-12);
        // Some of the crossings are left out: the best of them may be, and one next to it is there.
        double least = std::numeric_limits<double>::infinity(), to_found = least;
        for (std::size_t i = 0; i < crossings.size(); ++i) {
            const Vec3 q = crossings[i].point;
            least = std::min(least, distance2(p, n, q, probe->normal(q)));
            to_found = std::min(to_found, (q - point).norm());
        }
        EXPECT_EQ(to_found, 0.0);
        EXPECT_LT(std::sqrt(distance2(p, n, point, normal)), std::sqrt(least) + 0.1) << k;
    }
}

TEST(OrientedPlaces, IsEmptyWithoutASurface) {
    const auto solid = shapes::sphere({0, 0, 0}, 1.0, 0.05);
    const OrientedPlaces places(*solid, CrossingGrid(std::vector<Surface::Crossing>(), 0.05), 1.0);
    EXPECT_TRUE(places.empty());
}

}  // namespace
}  // namespace isotrack
