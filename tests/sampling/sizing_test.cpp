// The wanted spacing, held against formulas on simple surfaces.
#include "isotrack/sampling/sizing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"

namespace isotrack {
namespace {

using support::adjacency_of;
using support::along_tube;
using support::limits_of;
using support::nearest_distance;
using support::random_on_unit_sphere;
using support::settled_on_unit_sphere;

/// The error alone bounds the spacing.
SizingLimits limits_of_error(double tolerance) {
    SizingLimits limits{};
    limits.tolerance = tolerance;
    limits.angle = 2.0;
    limits.min_edge = 0.01;
    limits.max_edge = 10.0;
    return limits;
}

SizingEvidence of_errors(const std::vector<double>& error) {
    return {error, std::vector<double>(error.size(), std::numeric_limits<double>::infinity())};
}

TEST(ShareWithError, CountsThoseWhoseErrorIsKnown) {
    const SizingLimits limits = limits_of_error(0.01);
    EXPECT_EQ(share_with_error(of_errors({}), limits), 1.0);
    EXPECT_EQ(share_with_error(of_errors({-1.0, -1.0}), limits), 1.0);
    EXPECT_EQ(share_with_error(of_errors({-1.0, 0.0, 0.0005, 0.0025, 0.02}), limits), 0.5);
}

TEST(UpdateSpacing, GetsSmallerTheLargerTheError) {
    const Particles start = settled_on_unit_sphere(400, 0.19);
    const Adjacency adjacency = adjacency_of(start);
    SizingLimits limits = limits_of_error(0.01);
    // The actual spacing: the mean distance to neighbours within twice that of the nearest.
    double least_actual = 1e300, most_actual = 0.0;
    for (std::size_t i = 0; i < start.size(); ++i) {
        const double nearest = nearest_distance(start, i);
        double sum = 0.0;
        int count = 0;
        for (const int j : adjacency.of(i)) {
            const double d = (start.position[j] - start.position[i]).norm();
            if (d < 2.0 * nearest && start.normal[i].dot(start.normal[j]) > 0.0) sum += d, ++count;
        }
        least_actual = std::min(least_actual, sum / count);
        most_actual = std::max(most_actual, sum / count);
    }
    double last = 1e300, no_evidence = 0.0;
    for (const double error : {-1.0, 0.001, 0.004, 0.007, 0.01, 0.014, 0.1}) {
        Particles particles = start;
        update_spacing(particles, adjacency, of_errors(std::vector<double>(particles.size(), error)), limits);
        const double h = particles.spacing[0];
        if (error >= 0.0) {  // 1 / h^2 is at least half, at most twice 1 / (wanted x actual)
            EXPECT_GE(h, std::sqrt(0.19 * least_actual / 2.0) - 1e-12) << error;
            EXPECT_LE(h, std::sqrt(0.19 * most_actual * 2.0) + 1e-12) << error;
        }
        if (error < 0.0) {
            no_evidence = h;
            continue;
        }
        EXPECT_LE(h, last) << error;
        last = h;
    }
    EXPECT_NEAR(no_evidence, 0.19, 1e-12);
    EXPECT_LT(last, 0.19);
}

TEST(UpdateSpacing, AimsAtASmallerMeanSquareWhereMostParticlesHaveHardlyAnyError) {
    const Particles start = settled_on_unit_sphere(400, 0.19);
    const Adjacency adjacency = adjacency_of(start);
    SizingLimits limits = limits_of_error(0.01);
    // The spacing at the top, with an error above this height and none below.
    const auto at_top = [&](double height, bool mean_square_counts) {
        limits.mean_square_counts = mean_square_counts;
        std::vector<double> error;
        std::size_t top = 0;
        for (std::size_t i = 0; i < start.size(); ++i) {
            error.push_back(start.position[i].z() > height ? 0.7 * limits.tolerance : 0.0);
            if (start.position[i].z() > start.position[top].z()) top = i;
        }
        Particles particles = start;
        update_spacing(particles, adjacency, of_errors(error), limits);
        return particles.spacing[top];
    };
    EXPECT_EQ(at_top(-2.0, true), at_top(-2.0, false));
    EXPECT_EQ(at_top(0.0, false), at_top(-2.0, false));
    EXPECT_LT(at_top(0.0, true), 0.85 * at_top(0.0, false));
}

TEST(UpdateSpacing, AimsAtASmallerMeanSquareWhereParticlesAreFarApart) {
    Particles start = settled_on_unit_sphere(400, 0.19);
    std::size_t top = 0, bottom = 0;
    for (std::size_t i = 0; i < start.size(); ++i) {
        if (start.position[i].z() > 0.0) start.spacing[i] *= 2.0;
        if (start.position[i].z() > start.position[top].z()) top = i;
        if (start.position[i].z() < start.position[bottom].z()) bottom = i;
    }
    SizingLimits limits = limits_of_error(0.01);
    const auto updated = [&](bool mean_square_counts) {
        limits.mean_square_counts = mean_square_counts;
        Particles particles = start;
        update_spacing(particles, adjacency_of(start),
                       of_errors(std::vector<double>(start.size(), 0.7 * limits.tolerance)), limits);
        return particles.spacing;
    };
    const std::vector<double> plain = updated(false), weighed = updated(true);
    EXPECT_EQ(weighed[bottom], plain[bottom]);
    // An aim of (1 / 2)^(1/2) for 1/h^2 that is in inverse proportion to it.
    EXPECT_NEAR(weighed[top], std::pow(0.5, 0.25) * plain[top], 0.02 * plain[top]);
}

TEST(UpdateSpacing, KeepsBelowTheAngleAndTheThickness) {
    Particles particles = settled_on_unit_sphere(400, 0.19);
    const Adjacency adjacency = adjacency_of(particles);
    SizingLimits limits = limits_of_error(1.0);  // says nothing
    limits.angle = 0.1;                          // on the unit sphere the spacing itself
    SizingEvidence evidence = of_errors(std::vector<double>(particles.size(), 0.0));
    Particles by_angle = particles;
    for (int round = 0; round < 10; ++round) update_spacing(by_angle, adjacency, evidence, limits);
    for (const double h : by_angle.spacing) EXPECT_NEAR(h, 0.1, 0.01);
    limits.angle = 3.0;
    evidence.thickness[7] = 0.08;
    for (int round = 0; round < 10; ++round) update_spacing(particles, adjacency, evidence, limits);
    EXPECT_LE(particles.spacing[7], 0.08);
}

TEST(UpdateSpacing, StretchesAlongTheWayTheSurfaceBendsLess) {
    SizingLimits limits = limits_of(0.12);
    SizingEvidence evidence;
    const auto updated = [&](Particles particles) {
        evidence.error.assign(particles.size(), -1.0);
        evidence.thickness.assign(particles.size(), std::numeric_limits<double>::infinity());
        update_spacing(particles, adjacency_of(particles), evidence, limits);
        return particles;
    };
    const auto torus = shapes::torus({0, 0, 0}, 1.0, 0.3, 0.05);
    Particles particles;
    Id next_id = 0;
    cover(particles, *torus, CrossingGrid(*torus), limits, 1, next_id);
    for (int round = 0; round < 10; ++round) relax(particles, adjacency_of(particles), *torus, 3);
    const Particles on_torus = updated(particles);
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < on_torus.size(); ++i) {
        const Vec3 &p = on_torus.position[i], &stretch = on_torus.stretch[i];
        EXPECT_LE(stretch.squaredNorm(), 0.4 + 1e-9);
        EXPECT_NEAR(stretch.dot(on_torus.normal[i]), 0.0, 1e-6);
        if (std::hypot(p.x(), p.y()) < 1.0) continue;  // inside the hole both curvatures may be alike
        // Curvatures 1 / 0.3, and at most 1 / 1.3 the other way.
        EXPECT_GT(std::abs(stretch.normalized().dot(along_tube(p))), 0.9);
        sum += stretch.squaredNorm();
        ++count;
    }
    EXPECT_GT(sum / count, 0.35);
    const Particles on_sphere = updated(settled_on_unit_sphere(400, 0.19));
    for (const Vec3& stretch : on_sphere.stretch) EXPECT_LT(stretch.squaredNorm(), 0.1);
}

TEST(SpacingFromCurvature, GivesTheEdgeWhoseErrorIsTheTolerance) {
    // An equilateral triangle of edge h on a sphere of radius R is h^2 / 6R from it.
    SizingLimits limits{};
    limits.tolerance = 0.01;
    limits.angle = 1.5;
    limits.min_edge = 1e-3;
    limits.max_edge = 10.0;
    for (const double radius : {0.5, 1.0, 3.0}) {
        const auto sphere = shapes::sphere({0, 0, 0}, radius, 0.01);
        const auto probe = sphere->probe();
        const double h = spacing_from_curvature(*probe, {radius, 0, 0}, {1, 0, 0}, 0.01, limits);
        const double error = h * h / (6.0 * radius);
        EXPECT_LE(error, limits.tolerance);
        EXPECT_GE(error, 0.5 * limits.tolerance);
        limits.max_edge = 0.1;
        EXPECT_EQ(spacing_from_curvature(*probe, {radius, 0, 0}, {1, 0, 0}, 0.01, limits), 0.1);
        limits.max_edge = 10.0;
    }
}

TEST(UpdateSpacing, StaysWithinItsLimitsAndItsGradation) {
    Particles particles = random_on_unit_sphere(600, 0.15);
    const Adjacency adjacency = adjacency_of(particles);
    SizingLimits limits = limits_of(0.1);
    limits.tolerance = 0.01;
    limits.min_edge = 0.06;
    limits.max_edge = 0.5;
    SizingEvidence evidence;
    evidence.thickness.assign(particles.size(), std::numeric_limits<double>::infinity());
    evidence.error.assign(particles.size(), 0.0);
    evidence.error[17] = 1.0;  // one place far beyond the tolerance, all others far below
    for (int round = 0; round < 6; ++round) update_spacing(particles, adjacency, evidence, limits);
    for (std::size_t i = 0; i < particles.size(); ++i) {
        EXPECT_GE(particles.spacing[i], limits.min_edge);
        EXPECT_LE(particles.spacing[i], limits.max_edge);
    }
    EXPECT_LT(particles.spacing[17], 0.15);
    for (const int j : adjacency.of(17))
        if (particles.normal[17].dot(particles.normal[j]) > 0.0) {
            EXPECT_LE(particles.spacing[j],
                      particles.spacing[17] + 0.25 * (particles.position[j] - particles.position[17]).norm() +
                          1e-9);
        }
}

}  // namespace
}  // namespace isotrack
