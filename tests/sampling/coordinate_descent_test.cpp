// The paper's sampling by coordinate descent.
#include "isotrack/sampling/coordinate_descent.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/delaunay_neighbours.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"

namespace isotrack {
namespace {

using support::limits_of;
using support::nearest_distance;
using support::random_on_unit_sphere;

TEST(CoordinateDescent, SpreadsParticlesOverAnEllipsoidByItsCurvature) {
    const auto ellipsoid = shapes::ellipsoid({0, 0, 0}, {1.0, 0.5, 0.5}, 0.02);
    SizingLimits limits{};
    limits.tolerance = 1.0;
    limits.angle = 0.35;  // 20 degrees
    limits.min_edge = 0.01;
    limits.max_edge = 1.0;
    Particles particles;
    Id next_id = 0;
    cover(particles, *ellipsoid, CrossingGrid(*ellipsoid), limits, 1, next_id);
    const Id first_new = next_id;
    const std::size_t start = particles.size();
    DelaunayNeighbours structure(UpdateStrategy::Rebuild, particles.position);
    const CoordinateDescentReport report =
        coordinate_descent(particles, structure, *ellipsoid, limits, next_id);
    EXPECT_TRUE(report.converged);
    EXPECT_LE(report.steps, 40 * start);
    EXPECT_EQ(particles.size(), start + report.born - report.died);
    EXPECT_EQ(next_id, first_new + static_cast<Id>(report.born));
    EXPECT_EQ(std::set<Id>(particles.id.begin(), particles.id.end()).size(), particles.size());
    EXPECT_TRUE(std::is_sorted(particles.id.begin(), particles.id.end()));  // the others keep their order
    const auto probe = ellipsoid->probe();
    // Curvature is 4 at the tips and between 0.5 and 2 at the waist, so the tips are denser.
    double tip = 0.0, waist = 0.0;
    int tips = 0, waists = 0;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        EXPECT_LT(std::abs(probe->value(particles.position[i])), 1e-4);
        const double x = std::abs(particles.position[i].x()), d = nearest_distance(particles, i);
        if (x > 0.85) tip += d, ++tips;
        if (x < 0.4) waist += d, ++waists;
        EXPECT_GT(d, 0.35 * particles.spacing[i]);  // sigma_min 0.5 is a distance of 0.71 spacings, before
                                                    // neighbours move
    }
    ASSERT_GT(tips, 0);
    ASSERT_GT(waists, 0);
    EXPECT_LT(tip / tips, 0.8 * waist / waists);
}

TEST(CoordinateDescent, KeepsItsBudgetAndItsPopulationWhenTold) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.05);
    SizingLimits limits = limits_of(0.1);
    limits.max_edge = 1.0;
    limits.angle = 0.3;
    for (const int sweeps : {0, 1, 3}) {
        Particles particles = random_on_unit_sphere(150, 0.3);
        DelaunayNeighbours structure(UpdateStrategy::Rebuild, particles.position);
        CoordinateDescentOptions options;
        options.most_sweeps = sweeps;
        options.population = false;
        Id next_id = 150;
        const auto report = coordinate_descent(particles, structure, *sphere, limits, next_id, options);
        EXPECT_LE(report.steps, 150u * static_cast<std::size_t>(sweeps));
        EXPECT_EQ(report.born + report.died, 0u);
        EXPECT_EQ(particles.size(), 150u);
        EXPECT_EQ(next_id, 150);
        EXPECT_FALSE(report.converged);
    }
    Particles none;
    DelaunayNeighbours structure(UpdateStrategy::Rebuild, none.position);
    Id next_id = 0;
    EXPECT_TRUE(coordinate_descent(none, structure, *sphere, limits, next_id).converged);
}

TEST(CoordinateDescent, DependsOnItsSeedAlone) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.05);
    SizingLimits limits = limits_of(0.1);
    limits.max_edge = 1.0;
    limits.angle = 0.2;  // more particles than there are
    const auto run = [&](std::uint64_t seed) {
        Particles particles = random_on_unit_sphere(100, 0.3);
        DelaunayNeighbours structure(UpdateStrategy::Rebuild, particles.position);
        CoordinateDescentOptions options;
        options.seed = seed;
        Id next_id = 100;
        const auto report = coordinate_descent(particles, structure, *sphere, limits, next_id, options);
        EXPECT_GT(report.born, 50u);
        return particles.position;
    };
    const auto a = run(1);
    EXPECT_EQ(a, run(1));
    EXPECT_NE(a, run(2));
}

}  // namespace
}  // namespace isotrack
