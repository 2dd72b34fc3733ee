// What every frame promises, whatever the options.
#include "isotrack/tracking/tracker.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "isotrack/error.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/tracked.h"

namespace isotrack {
namespace {

using support::expect_sound;
using support::kVoxel;
using support::mesh_to_surface;
using support::sphere_at;
using support::surface_to_mesh;
using support::two_drops;
using support::with_tolerance;

TEST(Tracker, KeepsTheToleranceOnAMovingSphere) {
    for (const double tolerance : {0.03, 0.005}) {
        Tracker tracker(with_tolerance(tolerance));
        for (int f = 0; f < 5; ++f) {
            const auto sphere = sphere_at({0.03 * f, 0.01 * f, -0.02 * f});
            const TrackedFrame frame = tracker.advance(*sphere);
            expect_sound(frame, 1, 2, "frame " + std::to_string(f));
            EXPECT_TRUE(frame.within_tolerance);
            EXPECT_EQ(frame.lost_crossings, 0u);
            EXPECT_LE(frame.max_error, tolerance);
            EXPECT_LE(frame.rms_error, frame.max_error);
            const double there = mesh_to_surface(frame.mesh, *sphere),
                         back = surface_to_mesh(*sphere, frame.mesh, 29);
            EXPECT_LE(there, tolerance) << "frame " << f;
            EXPECT_LE(back, tolerance) << "frame " << f;
            // What it says of itself is what is measured: 28 points of a triangle see nearly the largest
            // error.
            EXPECT_NEAR(frame.max_error, std::max(there, back), 0.1 * tolerance);
        }
    }
}

TEST(Tracker, UsesFewTrianglesForATolerance) {
    // An equilateral triangle of edge h is h^2 / 6 from the unit sphere it is inscribed in.
    const double tolerance = 0.01, h2 = 6.0 * tolerance;
    const double ideal = 4.0 * 3.141592653589793 / (std::sqrt(3.0) / 4.0 * h2);
    const TrackedFrame frame = Tracker(with_tolerance(tolerance)).advance(*sphere_at(Vec3::Zero()));
    EXPECT_LT(static_cast<double>(frame.mesh.triangles.size()), 2.0 * ideal);
    auto angles = smallest_angles(frame.mesh);
    std::sort(angles.begin(), angles.end());
    EXPECT_GE(angles.front(), 15.0);
    EXPECT_GE(angles[angles.size() / 100], 30.0);
}

TEST(Tracker, KeepsTheVoidOfAGrowingShell) {
    Tracker tracker(with_tolerance(0.01));
    for (int f = 0; f < 4; ++f) {
        const auto shell = shapes::shell({0, 0, 0}, 0.7 + 0.04 * f, 0.2, kVoxel);
        expect_sound(tracker.advance(*shell), 2, 4, "frame " + std::to_string(f));
    }
}

TEST(Tracker, KeepsTheHoleOfATumblingTorusOnAGrid) {
    Tracker tracker(with_tolerance(0.5 * kVoxel));
    const auto torus = shapes::torus({0, 0, 0}, 0.7, 0.25, kVoxel);
    for (int f = 0; f < 4; ++f) {
        const Eigen::Isometry3d motion(Eigen::AngleAxisd(0.1 * f, Vec3(1, 2, 3).normalized()));
        const LevelSet level_set(rasterise(*shapes::moved(torus, motion), kVoxel));
        const TrackedFrame frame = tracker.advance(level_set);
        expect_sound(frame, 1, 0, "frame " + std::to_string(f));
        EXPECT_TRUE(frame.within_tolerance);
        EXPECT_LE(mesh_to_surface(frame.mesh, level_set),
                  0.5 * kVoxel * 1.02);  // between the points that were certified
    }
}

TEST(Tracker, GivesTheSameMeshesForTheSameSeedAtAnyThreadCount) {
    for (const Method method : {Method::Tolerance, Method::Paper}) {
        const auto run = [&](std::size_t threads, std::uint64_t seed) {
            const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
            TrackerOptions options = with_tolerance(0.01);
            options.seed = seed;
            options.method = method;
            options.fit = method == Method::Tolerance;
            Tracker tracker(options);
            std::vector<TriangleMesh> meshes;
            for (const double d : {0.66, 0.55, 0.66}) meshes.push_back(tracker.advance(*two_drops(d)).mesh);
            return meshes;
        };
        const auto one = run(1, 5), two = run(2, 5), other = run(2, 6);
        for (std::size_t f = 0; f < one.size(); ++f) {
            EXPECT_EQ(one[f].points, two[f].points) << f;
            EXPECT_EQ(one[f].triangles, two[f].triangles) << f;
            EXPECT_EQ(one[f].ids, two[f].ids) << f;
            EXPECT_EQ(one[f].velocities, two[f].velocities) << f;
            EXPECT_NE(one[f].points, other[f].points) << f;
        }
    }
}

TEST(Tracker, FitsWithFewerTrianglesWithinTheSameTolerance) {
    TrackerOptions options = with_tolerance(0.01);
    const auto sphere = sphere_at({0.1, 0.2, 0.3});
    const TrackedFrame plain = Tracker(options).advance(*sphere);
    options.fit = true;
    Tracker tracker(options);
    const TrackedFrame fitted = tracker.advance(*sphere);
    expect_sound(fitted, 1, 2, "fitted");
    EXPECT_TRUE(fitted.within_tolerance);
    EXPECT_LE(mesh_to_surface(fitted.mesh, *sphere), 0.01);
    EXPECT_LT(fitted.mesh.triangles.size(), plain.mesh.triangles.size());
    const double truth = 4.0 / 3.0 * 3.141592653589793;
    EXPECT_LT(std::abs(enclosed_volume(fitted.mesh) - truth),
              0.1 * std::abs(enclosed_volume(plain.mesh) - truth));
    // Particles stay on the surface.
    const auto probe = sphere->probe();
    for (const Vec3& p : tracker.particles().position) EXPECT_LT(std::abs(probe->value(p)), 1e-6);
}

TEST(Tracker, SowsWiderBeforeAFitButDenselyWhereFacesAreFlat) {
    const auto seeded = [](const shapes::SurfacePtr& solid, bool fit, std::optional<double> max_edge) {
        TrackerOptions options = with_tolerance(0.5 * kVoxel);
        options.fit = fit;
        options.max_edge = max_edge;
        return Tracker(options).advance(LevelSet(rasterise(*solid, kVoxel))).seeded;
    };
    const auto smooth = shapes::ellipsoid({0, 0, 0}, {3.0, 2.4, 2.0}, kVoxel);
    const auto flat = shapes::box({0, 0, 0}, {1.0, 0.8, 0.6}, kVoxel);
    EXPECT_LT(3 * seeded(smooth, true, {}), 2 * seeded(smooth, false, {}));
    EXPECT_GT(2 * seeded(flat, true, {}), 3 * seeded(flat, false, {}));
    // No seeds can be wider than these, and it is as smooth as it was.
    EXPECT_EQ(seeded(smooth, true, 4.0 * kVoxel), seeded(smooth, false, 4.0 * kVoxel));
}

TEST(Tracker, KeepsItsParticlesOnTheSurface) {
    const LevelSet level_set(rasterise(*shapes::torus({0, 0, 0}, 0.7, 0.25, kVoxel), kVoxel));
    Tracker tracker(with_tolerance(0.02));
    tracker.advance(level_set);
    const auto probe = level_set.probe();
    const Particles& particles = tracker.particles();
    for (std::size_t i = 0; i < particles.size(); ++i) {
        EXPECT_LT(std::abs(probe->value(particles.position[i])), 1e-3 * kVoxel);
        EXPECT_GT(particles.normal[i].dot(probe->normal(particles.position[i])), 0.999);
    }
}

TEST(Tracker, SamplesAsInThePaper) {
    TrackerOptions options = with_tolerance(0.05);
    options.method = Method::Paper;
    for (const Reconstruction reconstruction : {Reconstruction::Guided, Reconstruction::Pure}) {
        options.reconstruction = reconstruction;
        Tracker tracker(options);
        for (int f = 0; f < 2; ++f) {
            const TrackedFrame frame = tracker.advance(*sphere_at({0.03 * f, 0, 0}));
            expect_sound(frame, 1, 2, "frame " + std::to_string(f));
            EXPECT_EQ(mesh_topology(frame.mesh).genus(), 0);
        }
        // 20 degrees between neighbours' normals on the unit sphere: a spacing of about 0.35.
        double sum = 0.0;
        const Particles& particles = tracker.particles();
        for (const double h : particles.spacing) sum += h;
        EXPECT_NEAR(sum / static_cast<double>(particles.size()), 0.35, 0.05);
    }
}

TEST(Tracker, MayFollowTheParticlesInAnyWay) {
    TrackerOptions options = with_tolerance(0.02);
    for (const Method method : {Method::Tolerance, Method::Paper})
        for (const UpdateStrategy strategy :
             {UpdateStrategy::Auto, UpdateStrategy::Rebuild, UpdateStrategy::Lazy, UpdateStrategy::Move}) {
            options.method = method;
            options.delaunay = strategy;
            options.angle_deg = 20.0;
            Tracker tracker(options);
            for (int f = 0; f < 3; ++f) {
                const TrackedFrame frame = tracker.advance(*sphere_at({0.03 * f, 0, 0}));
                expect_sound(frame, 1, 2, std::string(name_of(strategy)) + " frame " + std::to_string(f));
                EXPECT_EQ(frame.delaunay_strategy, method == Method::Paper && strategy == UpdateStrategy::Auto
                                                       ? "lazy"
                                                       : name_of(strategy));
                if (strategy == UpdateStrategy::Rebuild) {
                    EXPECT_EQ(frame.relocated, 0u);
                }
                if (strategy == UpdateStrategy::Move && f > 0) {
                    EXPECT_GT(frame.relocated, 0u);
                }
            }
        }
}

TEST(Tracker, MayFitInAnyWay) {
    TrackerOptions options = with_tolerance(0.02);
    options.fit = true;
    for (const Method method : {Method::Tolerance, Method::Paper})
        for (const UpdateStrategy strategy :
             {UpdateStrategy::Auto, UpdateStrategy::Rebuild, UpdateStrategy::Lazy, UpdateStrategy::Move}) {
            options.method = method;
            options.delaunay = strategy;
            Tracker tracker(options);
            for (int f = 0; f < 2; ++f) {
                const TrackedFrame frame =
                    tracker.advance(*shapes::ellipsoid({0.03 * f, 0, 0}, {1.0, 0.7, 0.45}, kVoxel));
                expect_sound(frame, 1, 2, std::string(name_of(strategy)) + " frame " + std::to_string(f));
                EXPECT_TRUE(frame.within_tolerance || method == Method::Paper);
            }
        }
}

TEST(Tracker, GivesEveryShapeItsTopology) {
    const auto near = shapes::unite(
        {shapes::sphere(Vec3(-0.44, 0, 0), 0.4, 0.04), shapes::sphere(Vec3(0.44, 0, 0), 0.4, 0.04)});
    const struct {
        shapes::SurfacePtr shape;
        std::size_t components;
        long euler;
    } cases[] = {{shapes::torus(Vec3::Zero(), 0.7, 0.25, 0.04), 1, 0},
                 {shapes::shell(Vec3::Zero(), 0.8, 0.12, 0.04), 2, 4},
                 {shapes::plate(Vec3::Zero(), 0.7, 0.09, 0.04), 1, 2},
                 {shapes::box(Vec3::Zero(), Vec3(0.5, 0.4, 0.3), 0.04), 1, 2},
                 {near, 2, 4}};
    for (const auto& c : cases) {
        SCOPED_TRACE(&c - cases);
        const TrackedFrame result = Tracker(with_tolerance(0.02)).advance(*c.shape);
        expect_sound(result, c.components, c.euler, "");
        EXPECT_LE(mesh_to_surface(result.mesh, *c.shape), 0.02);
    }
}

TEST(Tracker, SamplesMoreDenselyWhereItIsCurvedAsInThePaper) {
    TrackerOptions o = with_tolerance(0.02);
    o.method = Method::Paper;
    Tracker tracker(o);
    // An ellipsoid: the density must follow the curvature.
    const auto ellipsoid = shapes::ellipsoid(Vec3::Zero(), Vec3(1.0, 0.4, 0.4), 0.04);
    expect_sound(tracker.advance(*ellipsoid), 1, 2, "");
    double tip = 0.0, waist = 0.0;
    int tips = 0, waists = 0;
    for (std::size_t i = 0; i < tracker.particles().size(); ++i) {
        const double x = std::abs(tracker.particles().position[i].x());
        if (x > 0.9) tip += tracker.particles().spacing[i], ++tips;
        if (x < 0.2) waist += tracker.particles().spacing[i], ++waists;
    }
    ASSERT_GT(tips, 0);
    ASSERT_GT(waists, 0);
    EXPECT_LT(tip / tips, 0.8 * waist / waists);
}

TEST(Tracker, KeepsEdgesWithinTheirBounds) {
    TrackerOptions options = with_tolerance(0.5);  // says nothing on a sphere of radius 1
    options.max_edge = 0.2;
    Tracker tracker(options);
    tracker.advance(*sphere_at({0, 0, 0}));
    for (const double h : tracker.particles().spacing) EXPECT_LE(h, 0.2);
    EXPECT_GT(tracker.particles().size(), 4.0 * 3.14 / (0.866 * 0.2 * 0.2) * 0.7);
}

TEST(Tracker, TakesNoMoreParticlesForABandFullOfHolesThanThereAreCrossings) {
    const auto grid = rasterise(*sphere_at({0, 0, 0}), 0.03);
    std::vector<openvdb::Coord> active;
    for (auto voxel = grid->cbeginValueOn(); voxel; ++voxel) active.push_back(voxel.getCoord());
    std::mt19937 random(1);
    for (const openvdb::Coord& c : active)
        if (random() % 20 == 0) grid->tree().setValueOff(c, grid->background());
    const LevelSet level_set(grid);
    Tracker tracker(with_tolerance(0.015));
    const TrackedFrame frame = tracker.advance(level_set);
    EXPECT_LT(frame.particles, level_set.crossing_count());
    const MeshTopology t = mesh_topology(frame.mesh);
    EXPECT_TRUE(t.closed() && t.oriented() && t.manifold());
    EXPECT_EQ(self_intersections(frame.mesh).size(), 0u);
    EXPECT_FALSE(frame.within_tolerance);
}

TEST(Tracker, SaysWhatTheOptionsComeTo) {
    const auto sphere = sphere_at({0, 0, 0});
    const SizingLimits fine = sizing_limits(with_tolerance(0.2 * kVoxel), *sphere),
                       coarse = sizing_limits(with_tolerance(3.0 * kVoxel), *sphere);
    EXPECT_DOUBLE_EQ(fine.min_edge, 0.5 * kVoxel);
    EXPECT_DOUBLE_EQ(fine.max_edge, 40.0 * kVoxel);
    EXPECT_DOUBLE_EQ(coarse.min_edge, 3.0 * kVoxel);
    EXPECT_DOUBLE_EQ(coarse.max_edge, 240.0 * kVoxel);
    TrackerOptions as_in_paper = with_tolerance(3.0 * kVoxel);
    as_in_paper.method = Method::Paper;
    EXPECT_DOUBLE_EQ(sizing_limits(as_in_paper, *sphere).min_edge, 0.5 * kVoxel);
    TrackerOptions bounded = with_tolerance(3.0 * kVoxel);
    bounded.max_edge = 2.0 * kVoxel;
    EXPECT_DOUBLE_EQ(sizing_limits(bounded, *sphere).max_edge, 2.0 * kVoxel);
    EXPECT_LE(sizing_limits(bounded, *sphere).min_edge, 2.0 * kVoxel);
}

TEST(Tracker, KeepsACoarseToleranceOnAFineGridWithFewParticles) {
    // The same sphere and tolerance on two grids: half a voxel of one is four of the other, beyond its band.
    const double tolerance = 0.02;
    std::vector<std::size_t> particles;
    for (const double voxel : {2.0 * tolerance, 0.25 * tolerance}) {
        const LevelSet level_set(rasterise(*sphere_at({0, 0, 0}), voxel));
        Tracker tracker(with_tolerance(tolerance));
        for (int frame = 0; frame < 2; ++frame) {
            const TrackedFrame result = tracker.advance(level_set);
            EXPECT_EQ(result.tolerance, tolerance);
            expect_sound(result, 1, 2, "sphere");
            const auto probe = sphere_at({0, 0, 0})->probe();
            for (const Triangle& t : result.mesh.triangles) {
                const Vec3 middle =
                    (result.mesh.points[t[0]] + result.mesh.points[t[1]] + result.mesh.points[t[2]]) / 3.0;
                EXPECT_LE(std::abs(probe->value(middle)), tolerance);
            }
            if (frame == 1) particles.push_back(result.particles);
        }
    }
    EXPECT_LT(particles[1],
              particles[0] * 3 / 2);  // in the band alone it would be held to 0.6 of the tolerance
}

TEST(Tracker, HoldsAToleranceBeyondTheBandToIt) {
    const LevelSet level_set(rasterise(*sphere_at({0, 0, 0}), 0.02));
    Tracker tracker(with_tolerance(0.2));
    const TrackedFrame frame = tracker.advance(level_set);
    EXPECT_LT(frame.tolerance, level_set.reach());
    expect_sound(frame, 1, 2, "sphere");
    const auto truth = sphere_at({0, 0, 0});
    const auto probe = truth->probe();
    for (const Triangle& t : frame.mesh.triangles) {
        const Vec3 middle =
            (frame.mesh.points[t[0]] + frame.mesh.points[t[1]] + frame.mesh.points[t[2]]) / 3.0;
        EXPECT_LE(std::abs(probe->value(middle)), frame.tolerance + 1e-3);
    }
}

TEST(Tracker, RefusesOptionsOutOfRange) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const double tolerance : {0.0, -1.0, nan})
        EXPECT_THROW(Tracker{with_tolerance(tolerance)}, OptionError);
    const auto refuses = [](const std::function<void(TrackerOptions&)>& spoil) {
        TrackerOptions options = with_tolerance(0.01);
        spoil(options);
        EXPECT_THROW(Tracker{options}, OptionError);
    };
    for (const double angle : {0.0, -5.0, 90.5, nan})
        refuses([&](TrackerOptions& o) { o.angle_deg = angle; });
    for (const double edge : {0.0, -0.1, nan}) {
        refuses([&](TrackerOptions& o) { o.min_edge = edge; });
        refuses([&](TrackerOptions& o) { o.max_edge = edge; });
    }
    refuses([](TrackerOptions& o) {
        o.min_edge = 0.2;
        o.max_edge = 0.1;
    });
    TrackerOptions most = with_tolerance(0.01);
    most.angle_deg = 90.0;
    EXPECT_NO_THROW(Tracker{most});
}

}  // namespace
}  // namespace isotrack
