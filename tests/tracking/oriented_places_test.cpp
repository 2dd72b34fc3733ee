// The place that is found is the nearest of all in position and normal.
#include "tracking/oriented_places.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr double kTurnLength = 0.4;

shapes::SurfacePtr torus_and_sphere(double resolution) {
    return shapes::unite(
        {shapes::torus({0, 0, 0}, 0.8, 0.25, resolution), shapes::sphere({0, 0, 0.8}, 0.3, resolution)});
}

/// How much farther the places that are found are than the nearest of all crossings, at most.
double largest_excess(const Surface& solid, const CrossingGrid& crossings, const OrientedPlaces& places) {
    const auto probe = solid.probe();
    std::vector<OrientedPlaces::Place> all;
    for (std::size_t i = 0; i < crossings.size(); ++i)
        all.push_back({crossings[i].point, probe->normal(crossings[i].point)});
    std::mt19937 random(1);
    std::normal_distribution<double> some;
    double excess = 0.0;
    for (int k = 0; k < 200; ++k) {
        const Vec3 p(some(random), some(random), 0.5 * some(random));
        const Vec3 n = Vec3(some(random), some(random), some(random)).normalized();
        const auto distance = [&](const OrientedPlaces::Place& place) {
            return std::sqrt((p - place.point).squaredNorm() +
                             kTurnLength * kTurnLength * (1.0 - n.dot(place.normal)));
        };
        const OrientedPlaces::Place& found = places.nearest(p, n);
        double least = std::numeric_limits<double>::infinity(), to_found = least;
        for (const auto& place : all) {
            least = std::min(least, distance(place));
            to_found =
                std::min(to_found, (place.point - found.point).norm() + (place.normal - found.normal).norm());
        }
        EXPECT_EQ(to_found, 0.0) << "not one of them";
        excess = std::max(excess, distance(found) - least);
    }
    return excess;
}

TEST(OrientedPlaces, FindsTheNearestInPlaceAndNormal) {
    const auto solid = torus_and_sphere(0.1);
    const CrossingGrid crossings(*solid);
    const OrientedPlaces places(*solid, crossings, kTurnLength);
    ASSERT_EQ(places.size(), crossings.size());
    EXPECT_LT(largest_excess(*solid, crossings, places), 1e-12);
}

TEST(OrientedPlaces, AreSpreadOverAllWhereThereAreMany) {
    const auto solid = torus_and_sphere(0.03);
    const CrossingGrid crossings(*solid);
    const OrientedPlaces places(*solid, crossings, kTurnLength);
    ASSERT_LT(places.size(), crossings.size() / 2);
    EXPECT_EQ(places.size(), 4000u);
    EXPECT_LT(largest_excess(*solid, crossings, places), 0.1);  // a tenth of the torus's minor circle
}

TEST(OrientedPlaces, LeavesOutWhatHasNoNormal) {
    // Half of the crossings are in the middle of a ball, far from the band of the grid.
    const LevelSet ball(rasterise(*shapes::sphere({0, 0, 0}, 1.0, 0.1), 0.1));
    const std::vector<Surface::Crossing> known = ball.crossings();
    std::vector<Surface::Crossing> all = known;
    for (std::size_t i = 0; i < known.size(); ++i) all.push_back({Vec3::Zero(), {1, 0, 0}});
    const OrientedPlaces places(ball, CrossingGrid(all, 0.1), kTurnLength);
    EXPECT_EQ(places.size(), known.size());
    for (const Surface::Crossing& crossing : known) {
        const Vec3 n = crossing.point.normalized();
        EXPECT_LT((places.nearest(crossing.point, n).point - crossing.point).norm(), 1e-5);
    }
}

TEST(OrientedPlaces, IsEmptyWithoutASurface) {
    const auto solid = shapes::sphere({0, 0, 0}, 1.0, 0.05);
    const OrientedPlaces places(*solid, CrossingGrid(std::vector<Surface::Crossing>(), 0.05), 1.0);
    EXPECT_TRUE(places.empty());
}

}  // namespace
}  // namespace isotrack
