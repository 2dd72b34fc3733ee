// One surface after the other: what stays the same from frame to frame, what comes, and what goes.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "isotrack/io/sample_sequence.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/tracker.h"
#include "support/tracked.h"

namespace isotrack {
namespace {

using shapes::SurfacePtr;
using support::expect_sound;
using support::kVoxel;
using support::mesh_to_surface;
using support::sphere_at;
using support::surface_to_mesh;
using support::two_drops;
using support::with_tolerance;

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

/// One that cannot be read any more after so many values.
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

TEST(Tracker, AddsAFewToThoseBeforeWithoutTetrahedralisingAgain) {
    // A ball that is stretched to a sheet: most frames want a few per cent more.
    int with_some = 0, with_many = 0;
    for (const double tolerance : {0.003, 0.0035, 0.004, 0.005}) {
        SampleSequence sequence("enright");
        Tracker tracker(with_tolerance(tolerance));
        for (int f = 0; f < 8; ++f) {
            const TrackedFrame frame = tracker.advance(LevelSet(sequence.next().surface));
            if (frame.seeded > 0) continue;  // sampled anew where much is
            // All but a few of them come when the mesh is held against the surface.
            const double born = static_cast<double>(frame.born) / static_cast<double>(frame.particles);
            if (born < 0.06) {
                EXPECT_EQ(frame.rebuilt, 1u) << "tolerance " << tolerance << ", frame " << f;
                with_some += born > 0.035;
            } else {
                with_many += frame.rebuilt > 1;
            }
        }
    }
    EXPECT_GT(with_some, 0);
    EXPECT_GT(with_many, 0);
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

}  // namespace
}  // namespace isotrack
