// Seeding and what follows: the promises of the sampling headers on a sphere and its like.
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/delaunay_neighbours.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"

namespace isotrack {
namespace {

using support::adjacency_of;
using support::along_tube;
using support::limits_of;
using support::nearest_distance;
using support::random_on_unit_sphere;

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

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

TEST(Particles, ComeAndGoAndChangePlacesWithAllThatBelongsToThem) {
    Particles particles;
    for (int i = 0; i < 5; ++i) {
        particles.add(Vec3(i, 0, 0), Vec3(0, i, 0), 0.1 * i, 10 + i, Vec3(0, 0, i));
        particles.stretch.back() = Vec3(i, i, 0);
    }
    particles.retain({1, 0, 1, 1, 1});
    particles.reorder({2, 0, 3, 1});
    ASSERT_EQ(particles.size(), 4u);
    const int expected[] = {3, 0, 4, 2};
    for (int k = 0; k < 4; ++k) {
        const int i = expected[k];
        EXPECT_EQ(particles.position[k], Vec3(i, 0, 0));
        EXPECT_EQ(particles.normal[k], Vec3(0, i, 0));
        EXPECT_EQ(particles.spacing[k], 0.1 * i);
        EXPECT_EQ(particles.stretch[k], Vec3(i, i, 0));
        EXPECT_EQ(particles.id[k], 10 + i);
        EXPECT_EQ(particles.velocity[k], Vec3(0, 0, i));
    }
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

/// Particles all over the unit sphere, well spread.
Particles settled_on_unit_sphere(std::size_t count, double spacing) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles = random_on_unit_sphere(count, spacing);
    for (int sweep = 0; sweep < 20; ++sweep) relax(particles, adjacency_of(particles), *sphere, 1);
    return particles;
}

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

TEST(Uncrowded, DropsTheShareOfThemThatTheBandSaysMostCrowdedFirst) {
    const Particles particles = random_on_unit_sphere(600, 0.15);
    const Adjacency adjacency = adjacency_of(particles);
    const auto dropped = [&](double share) {
        const auto keep = uncrowded(particles, adjacency, {0.65, 0.85, share});
        std::vector<std::size_t> result;
        for (std::size_t i = 0; i < keep.size(); ++i)
            if (!keep[i]) result.push_back(i);
        return result;
    };
    const std::size_t all = dropped(1.0).size();
    ASSERT_GT(all, 100u);
    EXPECT_EQ(dropped(0.5).size(), (all + 1) / 2);
    EXPECT_TRUE(dropped(0.0).empty());
    std::vector<char> is_first(particles.size(), 0);
    double farthest = 0.0, nearest = 1.0;
    for (const std::size_t i : dropped(0.5)) {
        is_first[i] = 1;
        farthest = std::max(farthest, nearest_distance(particles, i));
    }
    for (const std::size_t i : dropped(1.0))
        if (!is_first[i]) nearest = std::min(nearest, nearest_distance(particles, i));
    EXPECT_LE(farthest, nearest);
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

TEST(Adjacency, RingSquareGapsAndNewborn) {
    // A strip 0 1 2 3 4 of triangles.
    const Adjacency ring = ring_of({{0, 1, 2}, {1, 3, 2}, {2, 3, 4}}, 6);
    const auto list = [](const Adjacency& a, std::size_t i) {
        return std::vector<int>(a.of(i).begin(), a.of(i).end());
    };
    ASSERT_EQ(ring.size(), 6u);
    EXPECT_EQ(list(ring, 0), (std::vector<int>{1, 2}));
    EXPECT_EQ(list(ring, 2), (std::vector<int>{0, 1, 3, 4}));
    EXPECT_TRUE(list(ring, 5).empty());
    EXPECT_EQ(list(ring.squared(), 0), (std::vector<int>{1, 2, 3, 4}));
    EXPECT_EQ(list(ring.squared(), 4), (std::vector<int>{0, 1, 2, 3}));
    // Without 2 its neighbours 0 1 3 4 know each other; they are numbered 0 1 2 3 now.
    const Adjacency gap = ring.restricted({1, 1, 0, 1, 1, 1});
    ASSERT_EQ(gap.size(), 5u);
    EXPECT_EQ(list(gap, 0), (std::vector<int>{1, 2, 3}));
    EXPECT_EQ(list(gap, 2), (std::vector<int>{0, 1, 3}));
    const Adjacency more = ring.extended({{1, 2, 3}}, 8);
    ASSERT_EQ(more.size(), 8u);
    EXPECT_EQ(list(more, 6), (std::vector<int>{1, 2, 3}));
    EXPECT_EQ(list(more, 1), (std::vector<int>{0, 2, 3, 6}));
    EXPECT_TRUE(list(more, 7).empty());
}

TEST(Densifier, StopsAtTheMostThatMayBe) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles;
    particles.add({0, 0, 1}, {0, 0, 1}, 0.4, 0);
    Id next_id = 1;
    const std::vector<Shortage> places = {{{0, 0, 1}, 0.4}, {{1, 0, 0}, 0.4}, {{0, 1, 0}, 0.4}};
    EXPECT_EQ(Densifier(particles, *sphere, 0.05, kNoLimit, 1, next_id).add(places), 0u);
    Densifier five(particles, *sphere, 0.05, kNoLimit, 5, next_id);
    EXPECT_EQ(five.add(places), 4u);
    EXPECT_EQ(particles.size(), 5u);
    EXPECT_EQ(five.add(places), 0u);
}

TEST(Densifier, AddsWhereThereIsRoomSurroundsWhereNotAndComesToAnEnd) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles;
    particles.add({0, 0, 1}, {0, 0, 1}, 0.4, 0);
    Id next_id = 1;
    Densifier densifier(particles, *sphere, 0.05, kNoLimit, 1000, next_id);
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
    Densifier densifier(particles, *sphere, 0.01, kNoLimit, 1000, next_id);
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
    Densifier densifier(particles, *sphere, 0.01, 0.3, 1000, next_id);
    EXPECT_EQ(densifier.add({{{0.6, 0, 0.8}, 0.1}, {{0, 0, -1}, 0.5}}), 2u);
    for (const double h : particles.spacing) EXPECT_LE(h, 0.3);
}

TEST(Densifier, GetsDenserUntilASmallBodyHasRoomForMore) {
    // Places at the wanted distance from the particle on a ball are none of the ball's, or are taken.
    const auto ball = shapes::sphere({0, 0, 0}, 0.03, 0.1);
    Particles particles;
    particles.add({0, 0, 0.03}, {0, 0, 1}, 1.0, 0);
    Id next_id = 1;
    Densifier densifier(particles, *ball, 1e-4, kNoLimit, 1000, next_id);
    EXPECT_EQ(densifier.add({{{0, 0, 0.03}, 0.4, 0.1}}), 0u);
    EXPECT_GT(densifier.add({{{0, 0, 0.03}, 0.4, 0.001}}), 0u);
    EXPECT_LT(particles.spacing[0], 0.1);
}

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
