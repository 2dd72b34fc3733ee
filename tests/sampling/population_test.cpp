// Births, deaths, and what certify adds.
#include "isotrack/sampling/population.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/adjacency.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"

namespace isotrack {
namespace {

using support::adjacency_of;
using support::nearest_distance;
using support::random_on_unit_sphere;
using support::settled_on_unit_sphere;

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

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

TEST(Uncrowded, LeavesAGoodPackingAlone) {
    const Particles particles = settled_on_unit_sphere(400, 0.19);
    const auto keep = uncrowded(particles, adjacency_of(particles));
    EXPECT_EQ(std::count(keep.begin(), keep.end(), 1), 400);
}

TEST(Uncrowded, DropsTheMostCrowdedOfItsNeighbours) {
    const Particles particles = random_on_unit_sphere(600, 0.15);
    const Adjacency adjacency = adjacency_of(particles);
    const auto keep = uncrowded(particles, adjacency);
    // Every crowded particle went, or a neighbour did.
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (!keep[i] || nearest_distance(particles, i) > 0.64 * 0.15) continue;
        bool neighbour_went = false;
        for (const int j : adjacency.of(i)) neighbour_went = neighbour_went || !keep[j];
        EXPECT_TRUE(neighbour_went);
    }
}

/// The triangles of particles on the unit sphere: their convex hull.
std::vector<Triangle> hull(const Particles& particles) {
    const Tetrahedra cells = tetrahedralise(particles.position);
    std::vector<Triangle> triangles;
    for (std::size_t c = 0; c < cells.size(); ++c) {
        if (!cells.is_infinite(static_cast<int>(c))) continue;
        const auto& f = Tetrahedra::kFacet[cells.index_of(static_cast<int>(c), Tetrahedra::kInfinite)];
        triangles.push_back({cells.vertices[c][f[0]], cells.vertices[c][f[2]], cells.vertices[c][f[1]]});
    }
    return triangles;
}

TEST(FillSparse, AddsInLargeTrianglesAndNoTwoSideBySide) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles = settled_on_unit_sphere(100, 0.2);  // a good packing would be 0.38 apart
    const auto triangles = hull(particles);
    const std::size_t before = particles.size();
    Id next_id = 1000;
    const std::vector<Triangle> parents =
        fill_sparse(particles, triangles, adjacency_of(particles), *sphere, next_id);
    const std::size_t added = parents.size();
    EXPECT_GT(added, 20u);
    ASSERT_EQ(particles.size(), before + added);
    EXPECT_EQ(next_id, static_cast<Id>(1000 + added));
    for (std::size_t i = before; i < particles.size(); ++i) {
        EXPECT_NEAR(particles.position[i].norm(), 1.0, 1e-5);
        EXPECT_NEAR(particles.spacing[i], 0.2, 1e-12);
        EXPECT_GT(nearest_distance(particles, i), 0.85 * 0.2 * 0.99);
        const auto& [a, b, c] = parents[i - before];
        const Vec3 middle = (particles.position[a] + particles.position[b] + particles.position[c]) / 3.0;
        EXPECT_LT((particles.position[i] - middle).norm(), 0.4);
    }
    const auto fill = [&](Particles& all) {
        return fill_sparse(all, hull(all), adjacency_of(all), *sphere, next_id);
    };
    // Filled again and again it comes to an end, with no triangle left that is too large.
    for (int round = 0; round < 20 && !fill(particles).empty(); ++round) {
    }
    EXPECT_TRUE(fill(particles).empty());
    for (const auto& [a, b, c] : hull(particles)) {
        const Vec3 &p = particles.position[a], &q = particles.position[b], &r = particles.position[c];
        const double radius =
            (q - p).norm() * (r - q).norm() * (p - r).norm() / (2.0 * (q - p).cross(r - p).norm());
        EXPECT_LE(radius, 0.85 * 0.2 + 1e-9);
    }
}

TEST(FillSparse, LeavesAGoodPackingAlone) {
    Particles particles = settled_on_unit_sphere(400, 0.19);
    Id next_id = 400;
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const Adjacency adjacency = adjacency_of(particles);
    EXPECT_TRUE(fill_sparse(particles, hull(particles), adjacency, *sphere, next_id).empty());
    EXPECT_TRUE(fill_sparse(particles, {}, adjacency, *sphere, next_id).empty());
}

TEST(FillSparse, IsNotMisledByTrianglesThatAreNotThoseOfADT) {
    Particles particles = settled_on_unit_sphere(400, 0.19);
    const Adjacency adjacency = adjacency_of(particles);
    // Across every edge the corners beyond it and one of its ends: obtuse, and far larger than any real one.
    std::vector<Triangle> wrong;
    const auto triangles = hull(particles);
    for (const auto& [a, b, c] : triangles)
        for (const auto& t : triangles) {
            if (std::count(t.begin(), t.end(), a) + std::count(t.begin(), t.end(), b) != 2 ||
                std::count(t.begin(), t.end(), c) == 1)
                continue;
            for (const int d : t)
                if (d != a && d != b) wrong.push_back({a, d, c});
        }
    ASSERT_GE(wrong.size(), triangles.size());
    Id next_id = 400;
    EXPECT_TRUE(
        fill_sparse(particles, wrong, adjacency, *shapes::sphere({0, 0, 0}, 1.0, 0.1), next_id).empty());
}

TEST(Densifier, StopsAtTheMostThatMayBe) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles;
    particles.add({0, 0, 1}, {0, 0, 1}, 0.4, 0);
    Id next_id = 1;
    const std::vector<Shortage> places = {{{0, 0, 1}, 0.4}, {{1, 0, 0}, 0.4}, {{0, 1, 0}, 0.4}};
    EXPECT_EQ(Densifier(particles, *sphere, sphere->resolution(), 0.05, kNoLimit, 1, next_id).add(places),
              0u);
    Densifier five(particles, *sphere, sphere->resolution(), 0.05, kNoLimit, 5, next_id);
    EXPECT_EQ(five.add(places), 4u);
    EXPECT_EQ(particles.size(), 5u);
    EXPECT_EQ(five.add(places), 0u);
}

TEST(Densifier, AddsWhereThereIsRoomSurroundsWhereNotAndComesToAnEnd) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles;
    particles.add({0, 0, 1}, {0, 0, 1}, 0.4, 0);
    Id next_id = 1;
    Densifier densifier(particles, *sphere, sphere->resolution(), 0.05, kNoLimit, 1000, next_id);
    EXPECT_EQ(densifier.add({}), 0u);
    EXPECT_EQ(densifier.add({{{1.1, 0, 0}, 0.4}}), 1u);
    ASSERT_EQ(particles.size(), 2u);
    EXPECT_NEAR((particles.position[1] - Vec3(1, 0, 0)).norm(), 0.0, 1e-4);
    EXPECT_EQ(particles.position[1], Vec3(particles.position[1].cast<float>().cast<double>()));
    EXPECT_EQ(particles.id[1], 1);
    // Others may add particles, too.
    particles.add({0, 1, 0}, {0, 1, 0}, 0.4, next_id++);
    EXPECT_EQ(densifier.add({{{0, 1.1, 0}, 0.4, 0.3}}), 0u);
    // On the very place of the first: a ring of six around it, nearer at each call, down to the smallest
    // spacing.
    double ring = 0.4;
    for (int calls = 0; calls < 20; ++calls) {
        const std::size_t before = particles.size();
        const std::size_t added = densifier.add({{{0, 0, 1}, 0.4}});
        EXPECT_EQ(particles.size(), before + added);
        if (added == 0) break;
        ring *= 0.6;
        EXPECT_EQ(added, 6u);
        EXPECT_DOUBLE_EQ(particles.spacing[0], ring);
        for (std::size_t i = before; i < particles.size(); ++i)
            EXPECT_NEAR((particles.position[i] - Vec3(0, 0, 1)).norm(), ring, 0.1 * ring);
    }
    EXPECT_LT(0.6 * ring, 0.05);
    EXPECT_GE(ring, 0.05);
    particles.spacing[0] = 0.4;
    EXPECT_EQ(densifier.add({{{0, 0, 1}, 0.4, 0.3}}), 0u);
    EXPECT_DOUBLE_EQ(particles.spacing[0], 0.4);
    for (std::size_t i = 0; i < particles.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            EXPECT_GE((particles.position[i] - particles.position[j]).norm(), 0.7 * 0.05);
}

TEST(Densifier, GivesRoomForOneAtATimeWhereParticlesAreFarApart) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles;
    particles.add({0, 0, 1}, {0, 0, 1}, 0.8, 0);
    Id next_id = 1;
    Densifier densifier(particles, *sphere, sphere->resolution(), 0.01, kNoLimit, 1000, next_id);
    const Vec3 place = Vec3(0.6, 0, 0.8), beside = Vec3(0.65, 0.02, 0.76).normalized();
    const std::vector<Shortage> both = {{place, 0.1}, {beside, 0.1}};
    EXPECT_EQ(densifier.add(both), 1u);
    EXPECT_NEAR(particles.spacing[1], (place - Vec3(0, 0, 1)).norm(), 1e-3);
    // What is still short of particles then gets them.
    EXPECT_GT(densifier.add({{Vec3(0.9, 0, 0.4).normalized(), 0.1}}), 0u);
    // None is near, and no farther than eight resolutions is looked.
    EXPECT_EQ(densifier.add({{{0, 0, -1}, 0.1}}), 1u);
    EXPECT_NEAR(particles.spacing.back(), 0.8, 1e-6);
}

TEST(Densifier, GivesNoSpacingAboveItsLargest) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles;
    particles.add({0, 0, 1}, {0, 0, 1}, 0.3, 0);
    Id next_id = 1;
    Densifier densifier(particles, *sphere, sphere->resolution(), 0.01, 0.3, 1000, next_id);
    EXPECT_EQ(densifier.add({{{0.6, 0, 0.8}, 0.1}, {{0, 0, -1}, 0.5}}), 2u);
    for (const double h : particles.spacing) EXPECT_LE(h, 0.3);
}

TEST(Densifier, GetsDenserUntilASmallBodyHasRoomForMore) {
    // Places at the wanted distance from the particle on a ball are none of the ball's, or are taken.
    const auto ball = shapes::sphere({0, 0, 0}, 0.03, 0.1);
    Particles particles;
    particles.add({0, 0, 0.03}, {0, 0, 1}, 1.0, 0);
    Id next_id = 1;
    Densifier densifier(particles, *ball, ball->resolution(), 1e-4, kNoLimit, 1000, next_id);
    EXPECT_EQ(densifier.add({{{0, 0, 0.03}, 0.4, 0.1}}), 0u);
    EXPECT_GT(densifier.add({{{0, 0, 0.03}, 0.4, 0.001}}), 0u);
    EXPECT_LT(particles.spacing[0], 0.1);
}

}  // namespace
}  // namespace isotrack
