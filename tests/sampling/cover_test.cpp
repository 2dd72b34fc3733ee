// Seeding: what cover promises on a sphere and its like.
#include "isotrack/sampling/cover.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"

namespace isotrack {
namespace {

using support::limits_of;
using support::nearest_distance;

TEST(Cover, LeavesNoCrossingFarFromAParticleThatFacesItsWay) {
    constexpr double kEdge = 0.2;
    const auto surface = shapes::torus({0.01, 0.02, 0.03}, 1.0, 0.3, 0.05);
    Particles particles;
    Id next_id = 10;
    const std::size_t added =
        cover(particles, *surface, CrossingGrid(*surface), limits_of(kEdge), 1, next_id);
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
        EXPECT_GT(cover(particles, *surface, CrossingGrid(*surface), limits_of(0.2), 1, next_id), 0u);
        EXPECT_EQ(cover(particles, *surface, CrossingGrid(*surface), limits_of(0.2), 1, next_id), 0u);
    }
}

// Lattice nodes that lie on the surface: edges along it cross it there, square to its normal.
TEST(Cover, PutsNoTwoParticlesOnOnePlace) {
    const auto surface = shapes::shell({0, 0, 0}, 1.0, 0.3, 0.05);
    Particles particles;
    Id next_id = 0;
    cover(particles, *surface, CrossingGrid(*surface), limits_of(0.12), 1, next_id);
    for (std::size_t i = 0; i < particles.size(); ++i) ASSERT_GT(nearest_distance(particles, i), 0.01);
    EXPECT_EQ(cover(particles, *surface, CrossingGrid(*surface), limits_of(0.12), 1, next_id), 0u);
}

TEST(Cover, FindsEveryPartFromAColdStart) {
    const double h = 0.05;
    const auto surface = shapes::unite(
        {shapes::sphere({0, 0, 0}, 0.8, h), shapes::torus({0, 0, 2}, 0.6, 0.1, h),
         shapes::sphere({1.5, 0.3, 0}, 1.01 * 0.5 * std::sqrt(3.0) * h, h)});  // holds one lattice node
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        Particles particles;
        Id next_id = 0;
        SizingLimits limits = limits_of(0.1);
        limits.min_edge = 0.5 * h;
        limits.max_edge = 2.0;
        cover(particles, *surface, CrossingGrid(*surface), limits, seed, next_id);
        int sphere = 0, torus = 0, drop = 0;
        for (const Vec3& p : particles.position)
            ++((p - Vec3(1.5, 0.3, 0)).norm() < 3 * h ? drop : p.z() > 1.0 ? torus : sphere);
        EXPECT_GT(sphere, 20);
        EXPECT_GT(torus, 20);
        EXPECT_GE(drop, 2);
    }
}

TEST(Cover, FindsADropOfASingleVoxel) {
    const auto grid = openvdb::FloatGrid::create(0.15f);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.05));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-2), openvdb::Coord(2)).begin(); c; ++c)
        grid->tree().setValue(*c, static_cast<float>(0.05 * (std::sqrt((*c).asVec3d().lengthSqr()) - 0.5)));
    const LevelSet level_set(grid);
    ASSERT_EQ(level_set.crossing_count(), 6u);
    Particles particles;
    Id next_id = 0;
    SizingLimits limits = limits_of(0.1);
    limits.min_edge = 0.025;
    EXPECT_GE(cover(particles, level_set, CrossingGrid(level_set), limits, 1, next_id),
              4u);  // enough for a tetrahedron
}

TEST(Cover, SowsAsWideAsTheSowingSays) {
    // Flatter than either sowing is wide: seeds are as far apart as it lets them.
    constexpr double kSpacing = 0.05;
    const auto surface = shapes::sphere({0.01, 0.02, 0.03}, 60.0 * kSpacing, kSpacing);
    const CrossingGrid crossings(*surface);
    SizingLimits limits = limits_of(kSpacing);
    limits.max_edge = 100.0 * kSpacing;
    limits.tolerance = 0.4 * kSpacing;
    const auto widest = [&](const Sowing& sowing, const CrossingGrid& grid) {
        return widest_seed(sowing, *surface, grid, limits);
    };
    EXPECT_DOUBLE_EQ(widest(kSparseSeeds, crossings), 5.0 * kSpacing);  // ten tolerances are less
    EXPECT_DOUBLE_EQ(widest(kSparseSeedsFitted, crossings), 8.0 * kSpacing);
    std::vector<std::size_t> added;
    for (const Sowing& sowing : {kSparseSeeds, kSparseSeedsFitted}) {
        Particles particles;
        Id next_id = 0;
        added.push_back(cover(particles, *surface, crossings, limits, 1, next_id, sowing));
        EXPECT_EQ(cover(particles, *surface, crossings, limits, 1, next_id, sowing), 0u);
        for (const double h : particles.spacing) EXPECT_DOUBLE_EQ(h, widest(sowing, crossings));
    }
    EXPECT_LT(3 * added[1], 2 * added[0]);

    limits.tolerance = 2.0 * kSpacing;
    EXPECT_DOUBLE_EQ(widest(kSparseSeedsFitted, crossings), 10.0 * kSpacing);
    EXPECT_DOUBLE_EQ(widest(kSparseSeedsFitted, CrossingGrid(*surface, 3.0 * kSpacing)), 15.0 * kSpacing);
    limits.min_edge = 20.0 * kSpacing;
    EXPECT_DOUBLE_EQ(widest(kSparseSeedsFitted, crossings), limits.min_edge);
    limits.min_edge = kSpacing;
    limits.max_edge = 4.0 * kSpacing;
    EXPECT_DOUBLE_EQ(widest(kSparseSeedsFitted, crossings), limits.max_edge);
}

TEST(Cover, MendsOnlyTheHole) {
    const auto surface = shapes::sphere({0.01, 0.02, 0.03}, 1.0, 0.05);
    Particles particles;
    Id next_id = 0;
    cover(particles, *surface, CrossingGrid(*surface), limits_of(0.15), 1, next_id);
    const std::size_t before = particles.size();
    std::vector<char> keep(before, 1);
    for (std::size_t i = 0; i < before; ++i) keep[i] = particles.position[i].x() < 0.8;
    particles.retain(keep);
    const std::size_t left = particles.size();
    ASSERT_LT(left, before);
    const std::size_t added = cover(particles, *surface, CrossingGrid(*surface), limits_of(0.15), 1, next_id);
    EXPECT_GT(added, 0u);
    EXPECT_LE(added, 2 * (before - left));
    for (std::size_t i = left; i < particles.size(); ++i) {
        EXPECT_GT(particles.position[i].x(), 0.7);
        EXPECT_GE(particles.id[i], static_cast<Id>(before));
    }
}

TEST(Cover, DoesNotLetOneSideOfASheetStandForTheOther) {
    const double h = 0.05;
    const auto plate = shapes::plate({0, 0, 0}, 1.0, 2.0 * h, h);
    Particles particles;
    Id next_id = 0;
    cover(particles, *plate, CrossingGrid(*plate), limits_of(0.3), 1, next_id);
    std::vector<char> keep(particles.size());
    for (std::size_t i = 0; i < particles.size(); ++i) keep[i] = particles.normal[i].z() > -0.5;
    particles.retain(keep);
    const std::size_t left = particles.size();
    cover(particles, *plate, CrossingGrid(*plate), limits_of(0.3), 1, next_id);
    std::size_t below = 0;
    for (std::size_t i = left; i < particles.size(); ++i) below += particles.normal[i].z() < -0.5;
    EXPECT_GT(below, 20u);
}

}  // namespace
}  // namespace isotrack
