// One surface after the other: what stays the same from frame to frame, and what every frame promises.
#include "isotrack/tracking/tracker.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "isotrack/error.h"
#include "isotrack/io/sample_sequence.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/distance.h"

namespace isotrack {
namespace {

using shapes::SurfacePtr;
constexpr double kVoxel = 0.05;

TrackerOptions with_tolerance(double tolerance) {
    TrackerOptions options;
    options.tolerance = tolerance;
    return options;
}

class EmptySurface final : public Surface {
public:
    std::unique_ptr<Surface::Probe> probe() const override { return std::make_unique<Nothing>(); }
    double resolution() const override { return kVoxel; }
    Box bounds() const override { return {}; }

private:
    struct Nothing final : Surface::Probe {
        Nothing() : Probe(1e-9, kVoxel) {}
        double value(const Vec3&) override { return 1.0; }
        Surface::Sample sample(const Vec3&) override { return {1.0, Vec3::Zero()}; }
    };
};

/// Another that cannot be read any more after so many values.
class FailingSurface final : public Surface {
public:
    FailingSurface(SurfacePtr surface, long values) : surface_(std::move(surface)), left_(values) {}
    std::unique_ptr<Surface::Probe> probe() const override { return std::make_unique<Failing>(*this); }
    double resolution() const override { return surface_->resolution(); }
    Box bounds() const override { return surface_->bounds(); }
    /// Negative when it failed.
    long values_left() const { return left_; }

private:
    struct Failing final : Surface::Probe {
        explicit Failing(const FailingSurface& surface)
            : Probe(1e-9, kVoxel), of(surface), probe(surface.surface_->probe()) {}
        double value(const Vec3& p) override {
            of.count();
            return probe->value(p);
        }
        Surface::Sample sample(const Vec3& p) override {
            of.count();
            return probe->sample(p);
        }
        const FailingSurface& of;
        std::unique_ptr<Surface::Probe> probe;
    };
    void count() const {
        if (left_.fetch_sub(1) <= 0) throw std::runtime_error("the surface cannot be read");
    }
    SurfacePtr surface_;
    mutable std::atomic<long> left_;
};

/// What is promised of every frame, whatever the surface.
void expect_sound(const TrackedFrame& frame, std::size_t components, long euler, const std::string& where) {
    SCOPED_TRACE(where);
    const MeshTopology t = mesh_topology(frame.mesh);
    EXPECT_TRUE(t.closed());
    EXPECT_TRUE(t.oriented());
    EXPECT_TRUE(t.manifold());
    EXPECT_EQ(t.unused_vertices, 0u);
    EXPECT_EQ(t.components, components);
    EXPECT_EQ(t.euler, euler);
    EXPECT_EQ(self_intersections(frame.mesh).size(), 0u);
    EXPECT_GE(enclosed_volume(frame.mesh), 0.0);
    EXPECT_EQ(frame.mesh.ids.size(), frame.mesh.points.size());
    EXPECT_EQ(frame.mesh.velocities.size(), frame.mesh.points.size());
    const std::set<Id> ids(frame.mesh.ids.begin(), frame.mesh.ids.end());
    EXPECT_EQ(ids.size(), frame.mesh.ids.size());
    for (const Vec3& v : frame.mesh.velocities) EXPECT_TRUE(v.allFinite());
    for (const Vec3& p : frame.mesh.points)
        for (int k = 0; k < 3; ++k) {
            const volatile float single =
                static_cast<float>(p[k]);  // g++ 12 drops a mere cast there and back
            EXPECT_EQ(p[k], static_cast<double>(single)) << "not what a file can hold";
        }
}

/// Largest distance from the mesh to the surface, at many points of every triangle, by the surface's own
/// exact distance.
double mesh_to_surface(const TriangleMesh& mesh, const Surface& surface) {
    constexpr int kSteps = 12;
    const auto probe = surface.probe();
    double largest = 0.0;
    for (const auto& [a, b, c] : mesh.triangles)
        for (int i = 0; i <= kSteps; ++i)
            for (int j = 0; i + j <= kSteps; ++j) {
                const Vec3 p =
                    (i * mesh.points[a] + j * mesh.points[b] + (kSteps - i - j) * mesh.points[c]) / kSteps;
                largest = std::max(largest, std::abs(probe->value(p)));
            }
    return largest;
}

/// Largest distance from the surface to the mesh, at every `stride`-th of its lattice crossings, put onto the
/// surface.
double surface_to_mesh(const Surface& surface, const TriangleMesh& mesh, std::size_t stride) {
    const auto probe = surface.probe();
    const auto crossings = surface.crossings();
    double largest = 0.0;
    for (std::size_t i = 0; i < crossings.size(); i += stride)
        if (const auto p = probe->project(crossings[i].point))
            largest = std::max(largest, support::distance_to_mesh(*p, mesh));
    return largest;
}

SurfacePtr sphere_at(const Vec3& centre, double radius = 1.0) {
    return shapes::sphere(centre, radius, kVoxel);
}

SurfacePtr two_drops(double half_distance) {
    return shapes::blended_spheres({-half_distance, 0, 0}, 0.5, {half_distance, 0, 0}, 0.5, 0.15, kVoxel);
}

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

TEST(Tracker, MergesAndSplitsDrops) {
    Tracker tracker(with_tolerance(0.01));
    const double distances[] = {0.7, 0.66, 0.55, 0.5, 0.45, 0.5, 0.55, 0.66, 0.7};
    const std::size_t drops[] = {2, 2, 1, 1, 1, 1, 1, 2, 2};
    for (int f = 0; f < 9; ++f) {
        const auto surface = two_drops(distances[f]);
        const TrackedFrame frame = tracker.advance(*surface);
        expect_sound(frame, drops[f], 2 * static_cast<long>(drops[f]), "frame " + std::to_string(f));
        EXPECT_LE(mesh_to_surface(frame.mesh, *surface), 0.01) << f;
        EXPECT_LE(surface_to_mesh(*surface, frame.mesh, 17), 0.01) << f;
    }
}

TEST(Tracker, FindsWhatIsBornAndDropsWhatDies) {
    Tracker tracker(with_tolerance(0.01));
    const auto large = sphere_at({0, 0, 0}),
               both = shapes::unite({sphere_at({0, 0, 0}), sphere_at({1.4, 0, 0}, 0.1)});
    expect_sound(tracker.advance(*large), 1, 2, "alone");
    const TrackedFrame born = tracker.advance(*both);
    expect_sound(born, 2, 4, "born");
    EXPECT_GT(born.seeded, 0u);
    EXPECT_GT(born.born, 0u);
    EXPECT_LE(surface_to_mesh(*both, born.mesh, 17), 0.01);
    const TrackedFrame died = tracker.advance(*large);
    expect_sound(died, 1, 2, "died");
    EXPECT_GT(died.died, 0u);
}

TEST(Tracker, MeetsAnewWhatHasGoneFartherThanItsParticlesCanFollow) {
    for (const bool fit : {false, true}) {
        TrackerOptions options = with_tolerance(0.01);
        options.fit = fit;
        Tracker follows(options), fresh(options);
        const auto box_at = [](double x) {
            return LevelSet(rasterise(*shapes::box({x, 0, 0}, {0.9, 0.6, 0.5}, kVoxel), kVoxel));
        };
        const LevelSet here = box_at(0), there = box_at(20);
        const std::size_t before = follows.advance(here).particles;
        const TrackedFrame frame = follows.advance(there);
        expect_sound(frame, 1, 2, fit ? "fitted" : "plain");
        EXPECT_EQ(frame.lost, before);
        EXPECT_EQ(frame.died, before);
        EXPECT_EQ(frame.born, frame.particles);
        const TrackedFrame first = fresh.advance(there);
        EXPECT_EQ(frame.mesh.points, first.mesh.points);
        EXPECT_EQ(frame.mesh.triangles, first.mesh.triangles);
    }
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

TEST(Tracker, NeverReusesAnId) {
    Tracker tracker(with_tolerance(0.01));
    std::set<Id> gone, alive;
    const double distances[] = {0.7, 0.66, 0.55, 0.45, 0.55, 0.66, 0.7, 0.5};
    for (const double d : distances) {
        const TrackedFrame frame = tracker.advance(*two_drops(d));
        const Particles& particles = tracker.particles();
        const std::set<Id> now(particles.id.begin(), particles.id.end());
        EXPECT_EQ(now.size(), particles.size());
        EXPECT_EQ(frame.particles, particles.size());
        std::size_t born = 0, died = 0;
        for (const Id id : now) {
            EXPECT_EQ(gone.count(id), 0u);
            EXPECT_GE(id, 0);
            born += alive.count(id) == 0;
        }
        for (const Id id : alive)
            if (now.count(id) == 0) {
                gone.insert(id);
                ++died;
            }
        EXPECT_EQ(frame.born, born);
        EXPECT_EQ(frame.died, died);
        // A vertex has the id of its particle.
        for (std::size_t v = 0; v < frame.mesh.ids.size(); ++v)
            if (frame.mesh.ids[v] <= *now.rbegin()) {
                EXPECT_EQ(now.count(frame.mesh.ids[v]), 1u);
            }
        alive = now;
    }
}

TEST(Tracker, KeepsIdsWhereTheyAreThroughManyBirths) {
    Tracker tracker(with_tolerance(0.004));
    constexpr double kGrowth = 0.06;
    std::map<Id, Vec3> before;
    std::size_t born = 0, first = 0;
    for (int f = 0; f < 10; ++f) {
        born += tracker.advance(*sphere_at({0, 0, 0}, 0.5 + kGrowth * f)).born;
        const Particles& particles = tracker.particles();
        if (f == 0) first = born;
        std::map<Id, Vec3> now;
        double farthest = 0.0, mean_spacing = 0.0;
        for (std::size_t i = 0; i < particles.size(); ++i) {
            now[particles.id[i]] = particles.position[i];
            mean_spacing += particles.spacing[i] / static_cast<double>(particles.size());
            const auto old = before.find(particles.id[i]);
            if (old != before.end())
                farthest = std::max(farthest, (particles.position[i] - old->second).norm());
        }
        EXPECT_LT(farthest, kGrowth + mean_spacing) << f;
        before = now;
    }
    EXPECT_GT(born, first + first / 2);  // so many that the particles do not keep their order
}

TEST(Tracker, AddsAFewToThoseBeforeWithoutTetrahedralisingAgain) {
    // A ball that is stretched to a sheet: most frames want a few per cent more.
    SampleSequence sequence("enright");
    Tracker tracker(with_tolerance(0.005));
    int with_some = 0, with_many = 0;
    for (int f = 0; f < 6; ++f) {
        const TrackedFrame frame = tracker.advance(LevelSet(sequence.next().surface));
        if (frame.seeded > 0) continue;  // sampled anew where much is
        // All but a few of them come when the mesh is held against the surface.
        const double born = static_cast<double>(frame.born) / static_cast<double>(frame.particles);
        if (born < 0.06) {
            EXPECT_EQ(frame.rebuilt, 1u) << "frame " << f;
            with_some += born > 0.035;
        } else {
            with_many += frame.rebuilt > 1;
        }
    }
    EXPECT_GT(with_some, 0);
    EXPECT_GT(with_many, 0);
}

TEST(Tracker, KeepsMostIdsWhenTheMotionIsSlow) {
    Tracker tracker(with_tolerance(0.01));
    std::set<Id> before;
    for (int f = 0; f < 6; ++f) {
        tracker.advance(*sphere_at({0.2 * kVoxel * f, 0, 0}));
        const std::set<Id> now(tracker.particles().id.begin(), tracker.particles().id.end());
        std::size_t kept = 0;
        for (const Id id : before) kept += now.count(id);
        if (f > 0) {
            EXPECT_GE(static_cast<double>(kept), 0.8 * static_cast<double>(before.size())) << f;
            EXPECT_GE(static_cast<double>(kept), 0.8 * static_cast<double>(now.size())) << f;
        }
        before = now;
    }
}

TEST(Tracker, GoesThroughEmptyFrames) {
    Tracker tracker(with_tolerance(0.01));
    const EmptySurface nothing;
    const TrackedFrame first = tracker.advance(nothing);
    EXPECT_TRUE(first.mesh.empty());
    EXPECT_TRUE(first.mesh.points.empty());
    EXPECT_EQ(first.particles, 0u);
    EXPECT_TRUE(first.within_tolerance);

    expect_sound(tracker.advance(*sphere_at({0, 0, 0})), 1, 2, "first");
    const std::set<Id> before(tracker.particles().id.begin(), tracker.particles().id.end());
    const TrackedFrame gap = tracker.advance(nothing);
    EXPECT_TRUE(gap.mesh.empty());
    EXPECT_EQ(gap.died, before.size());
    EXPECT_TRUE(tracker.particles().empty());
    expect_sound(tracker.advance(*sphere_at({0.5, 0, 0})), 1, 2, "again");
    for (const Id id : tracker.particles().id) EXPECT_GT(id, *before.rbegin());
}

TEST(Tracker, GivesTheDisplacementAsVelocity) {
    const Vec3 step(0.02, -0.01, 0.015);
    for (const bool told : {true, false}) {
        SCOPED_TRACE(told ? "with a velocity field" : "without a velocity field");
        Tracker tracker(with_tolerance(0.01));
        Tracker::Motion motion;
        if (told) motion = [&](const Vec3& p) { return Vec3(p + step); };
        for (int f = 0; f < 4; ++f) {
            const Vec3 centre = f * step;
            const TrackedFrame frame = tracker.advance(*sphere_at(centre), motion);
            if (f == 0) {
                for (const Vec3& v : frame.mesh.velocities) EXPECT_TRUE(v.isZero());
                continue;
            }
            double sum = 0.0;
            for (std::size_t v = 0; v < frame.mesh.points.size(); ++v) {
                // Without a velocity field nothing shows whether a sphere turns.
                const Vec3 n = (frame.mesh.points[v] - centre).normalized();
                const Vec3 error = frame.mesh.velocities[v] - step;
                const double e = (told ? error.norm() : std::abs(error.dot(n))) / step.norm();
                EXPECT_LT(e, told ? 0.05 : 0.3) << "frame " << f;
                sum += e;
            }
            EXPECT_LT(sum / static_cast<double>(frame.mesh.points.size()), told ? 0.01 : 0.05)
                << "frame " << f;
        }
    }
}

TEST(Tracker, IsNotLedAstrayByAWrongMotion) {
    // A velocity field in an unknown unit: a hundred times too fast.
    const Vec3 step(0.02, 0, 0);
    Tracker tracker(with_tolerance(0.01));
    for (int f = 0; f < 3; ++f) {
        const TrackedFrame frame =
            tracker.advance(*sphere_at(f * step), [&](const Vec3& p) { return Vec3(p + 100.0 * step); });
        expect_sound(frame, 1, 2, "frame " + std::to_string(f));
        if (f > 0) {
            EXPECT_LT(static_cast<double>(frame.lost), 0.05 * static_cast<double>(frame.particles));
        }
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

TEST(Tracker, FollowsBallsThatCutIntoEachOther) {
    Tracker tracker(with_tolerance(0.02));
    const auto pair = [](double gap) {
        return shapes::unite({shapes::sphere(Vec3(-0.4 - gap, 0, 0), 0.4, 0.04),
                              shapes::sphere(Vec3(0.4 + gap, 0, 0), 0.4, 0.04)});
    };
    expect_sound(tracker.advance(*pair(0.1)), 2, 4, "");
    expect_sound(tracker.advance(*pair(-0.1)), 1, 2, "");
    expect_sound(tracker.advance(*pair(0.1)), 2, 4, "");
    const auto with_drop = shapes::unite({pair(0.1), shapes::sphere(Vec3(0, 1, 0), 0.1, 0.04)});
    const TrackedFrame born = tracker.advance(*with_drop);
    expect_sound(born, 3, 6, "");
    EXPECT_GT(born.seeded, 0u);
    expect_sound(tracker.advance(*pair(0.1)), 2, 4, "");
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

TEST(Tracker, GoesOnAfterAFrameThatFailedMidway) {
    // Of a ring that grows: particles are added after it was meshed.
    const auto ring = shapes::torus({0, 0, 0}, 1.0, 0.2, kVoxel),
               grown = shapes::torus({0.02, 0, 0}, 1.1, 0.3, kVoxel);
    constexpr long kMany = 1'000'000'000;
    for (const bool fit : {false, true}) {
        TrackerOptions options = with_tolerance(0.005);
        options.fit = fit;
        Tracker whole(options);
        whole.advance(*ring);
        const FailingSurface counted(grown, kMany);
        whole.advance(counted);
        const auto values = static_cast<double>(kMany - counted.values_left());
        for (const double share : {0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99}) {
            Tracker tracker(options);
            tracker.advance(*ring);
            EXPECT_THROW(tracker.advance(FailingSurface(grown, static_cast<long>(share * values))),
                         std::runtime_error);
            const TrackedFrame frame = tracker.advance(*grown);
            expect_sound(frame, 1, 0, std::to_string(share));
            EXPECT_TRUE(frame.within_tolerance) << share;
        }
    }
}

}  // namespace
}  // namespace isotrack
