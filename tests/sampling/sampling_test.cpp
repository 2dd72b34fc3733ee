// Seeding and what follows: the promises of the sampling headers on a sphere and its like.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

SizingLimits limits_of(double edge) {
    SizingLimits limits{};
    limits.tolerance = 0.1 * edge;
    limits.angle = 0.7;
    limits.min_edge = limits.max_edge = edge;
    return limits;
}

Particles random_on_unit_sphere(std::size_t count, double spacing) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    Particles particles;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 n = Vec3(normal(random), normal(random), normal(random)).normalized();
        particles.add(n, n, spacing, static_cast<Id>(i));
    }
    return particles;
}

Adjacency adjacency_of(const Particles& particles) {
    return vertex_adjacency(tetrahedralise(particles.position), particles.size());
}

double nearest_distance(const Particles& particles, std::size_t i) {
    double least = 1e300;
    for (std::size_t j = 0; j < particles.size(); ++j)
        if (j != i) least = std::min(least, (particles.position[j] - particles.position[i]).norm());
    return least;
}

TEST(Cover, LeavesNoCrossingFarFromAParticleThatFacesItsWay) {
    constexpr double kEdge = 0.2;
    const auto surface = shapes::torus({0.01, 0.02, 0.03}, 1.0, 0.3, 0.05);
    Particles particles;
    Id next_id = 10;
    const std::size_t added = cover(particles, *surface, limits_of(kEdge), 1, next_id);
    EXPECT_EQ(added, particles.size());
    EXPECT_EQ(next_id, static_cast<Id>(10 + added));
    EXPECT_EQ(std::set<Id>(particles.id.begin(), particles.id.end()).size(), added);
    const auto probe = surface->probe();
    for (std::size_t i = 0; i < particles.size(); ++i) {
        EXPECT_LT(std::abs(probe->value(particles.position[i])), 1e-6);
        EXPECT_NEAR(particles.normal[i].norm(), 1.0, 1e-12);
    }
    for (const auto& c : surface->crossings()) {
        double least = 1e300;
        for (std::size_t i = 0; i < particles.size(); ++i)
            if (particles.normal[i].dot(c.outward.cast<double>()) > -0.02)
                least = std::min(least, (particles.position[i] - c.point).norm());
        ASSERT_LT(least, kEdge);
    }
}

TEST(Cover, AddsNothingTheSecondTime) {
    for (const auto& surface :
         {shapes::sphere({0.01, 0.02, 0.03}, 1.0, 0.05), shapes::torus({0, 0, 0}, 1.0, 0.3, 0.05),
          shapes::plate({0, 0, 0}, 1.0, 0.1, 0.05), shapes::shell({0.01, 0, 0}, 1.0, 0.3, 0.05)}) {
        Particles particles;
        Id next_id = 0;
        EXPECT_GT(cover(particles, *surface, limits_of(0.2), 1, next_id), 0u);
        EXPECT_EQ(cover(particles, *surface, limits_of(0.2), 1, next_id), 0u);
    }
}

// Lattice nodes that lie on the surface: edges along it cross it there, square to its normal.
TEST(Cover, PutsNoTwoParticlesOnOnePlace) {
    const auto surface = shapes::shell({0, 0, 0}, 1.0, 0.3, 0.05);
    Particles particles;
    Id next_id = 0;
    cover(particles, *surface, limits_of(0.12), 1, next_id);
    for (std::size_t i = 0; i < particles.size(); ++i) ASSERT_GT(nearest_distance(particles, i), 0.01);
    EXPECT_EQ(cover(particles, *surface, limits_of(0.12), 1, next_id), 0u);
}

TEST(ColourGroups, HoldEveryParticleOnceAndNoTwoNeighbours) {
    const Particles particles = random_on_unit_sphere(500, 0.15);
    const Adjacency adjacency = adjacency_of(particles);
    std::vector<int> colour(particles.size(), -1);
    const auto groups = colour_groups(adjacency);
    for (std::size_t g = 0; g < groups.size(); ++g)
        for (const int i : groups[g]) {
            EXPECT_EQ(colour[i], -1);
            colour[i] = static_cast<int>(g);
        }
    for (std::size_t i = 0; i < particles.size(); ++i) {
        ASSERT_GE(colour[i], 0);
        for (const int j : adjacency.of(i)) ASSERT_NE(colour[i], colour[j]);
    }
}

TEST(Relax, SpreadsRandomPointsAndKeepsThemOnTheSurface) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles = random_on_unit_sphere(400, 0.2);
    const auto mean_nearest = [&] {
        double sum = 0.0;
        for (std::size_t i = 0; i < particles.size(); ++i) sum += nearest_distance(particles, i);
        return sum / static_cast<double>(particles.size());
    };
    const double before = mean_nearest();
    for (int round = 0; round < 10; ++round) relax(particles, adjacency_of(particles), *sphere, 3);
    // A hexagonal packing of 400 points would have them 0.19 apart.
    EXPECT_GT(mean_nearest(), 1.5 * before);
    EXPECT_GT(mean_nearest(), 0.75 * 0.19);
    for (std::size_t i = 0; i < particles.size(); ++i) {
        EXPECT_NEAR(particles.position[i].norm(), 1.0, 1e-4);
        EXPECT_LT((particles.normal[i] - particles.position[i].normalized()).norm(), 1e-4);
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

TEST(Uncrowded, DropsCrowdedParticlesButNoTwoNeighbours) {
    const Particles particles = random_on_unit_sphere(600, 0.15);
    const Adjacency adjacency = adjacency_of(particles);
    const auto keep = uncrowded(particles, adjacency);
    ASSERT_EQ(keep.size(), particles.size());
    std::size_t dropped = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
        if (keep[i]) continue;
        ++dropped;
        EXPECT_LT(nearest_distance(particles, i), 0.65 * 0.15);
        for (const int j : adjacency.of(i)) EXPECT_TRUE(keep[j]);
    }
    EXPECT_GT(dropped, 50u);
}

TEST(Densify, AddsWhereThereIsRoomShrinksWhereNotAndComesToAnEnd) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles;
    particles.add({0, 0, 1}, {0, 0, 1}, 0.4, 0);
    Id next_id = 1;
    EXPECT_EQ(densify(particles, {}, *sphere, 0.05, next_id), 0u);
    EXPECT_EQ(densify(particles, {{{1.1, 0, 0}, 0.4}}, *sphere, 0.05, next_id), 1u);
    ASSERT_EQ(particles.size(), 2u);
    EXPECT_NEAR((particles.position[1] - Vec3(1, 0, 0)).norm(), 0.0, 1e-4);
    EXPECT_EQ(particles.id[1], 1);
    // On the very place of the first: only its spacing can shrink, down to the smallest.
    int calls = 0;
    while (densify(particles, {{{0, 0, 1}, 0.4}}, *sphere, 0.05, next_id) > 0) ASSERT_LT(++calls, 20);
    EXPECT_EQ(particles.size(), 2u);
    EXPECT_DOUBLE_EQ(particles.spacing[0], 0.05);
}

}  // namespace
}  // namespace isotrack
