// Motions that are known, found again from the surfaces alone.
#include "tracking/registration.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/limb.h"
#include "support/ringed_samples.h"

namespace isotrack {
namespace {

using shapes::SurfacePtr;
constexpr double kResolution = 0.05;

Eigen::Isometry3d motion_by(double degrees, const Vec3& axis, const Vec3& shift) {
    return Eigen::Translation3d(shift) *
           Eigen::AngleAxisd(degrees * 3.14159265358979 / 180.0, axis.normalized());
}

struct Sampled : support::RingedSamples {
    explicit Sampled(const SurfacePtr& surface, double edge = 0.12) : RingedSamples(surface, edge) {}
};

std::optional<std::vector<Vec3>> register_on(const Surface& surface, const Sampled& sampled,
                                             const std::vector<Vec3>& guess) {
    const CrossingGrid grid(surface);
    const auto crossings = [&]() -> const CrossingGrid& { return grid; };
    return register_to(surface, crossings, sampled.particles, sampled.ring, guess);
}

/// The largest distance from where `truth` takes the particles, over the largest displacement.
double error_of(const std::vector<Vec3>& found, const Particles& particles,
                const std::vector<Eigen::Isometry3d>& truth) {
    double farthest = 0.0, longest = 0.0;
    for (std::size_t i = 0; i < found.size(); ++i) {
        double least = std::numeric_limits<double>::infinity();
        for (const Eigen::Isometry3d& motion : truth)
            least = std::min(least, (found[i] - motion * particles.position[i]).norm());
        farthest = std::max(farthest, least);
    }
    for (const Eigen::Isometry3d& motion : truth)
        for (const Vec3& p : particles.position) longest = std::max(longest, (motion * p - p).norm());
    return farthest / longest;
}

TEST(Registration, FollowsWhatTurnsAlongItsSurface) {
    const SurfacePtr solids[] = {shapes::ellipsoid({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution),
                                 shapes::box({0, 0, 0}, {0.8, 0.6, 0.5}, kResolution),
                                 shapes::torus({0, 0, 0}, 0.8, 0.25, kResolution)};
    const Vec3 axes[] = {{0.3, 0.2, 1.0}, {0.3, 0.2, 1.0}, {1.0, 0.3, 0.0}};  // a torus slides around its own
    for (int k = 0; k < 3; ++k) {
        const Sampled sampled(solids[k]);
        const Eigen::Isometry3d motion = motion_by(4.0, axes[k], {0.02, 0.01, -0.015});
        const auto found =
            register_on(*shapes::moved(solids[k], motion), sampled, sampled.particles.position);
        ASSERT_TRUE(found) << k;
        EXPECT_LT(error_of(*found, sampled.particles, {motion}), 0.1) << k;
    }
}

TEST(Registration, GoesOnFromAGuess) {
    const auto solid = shapes::ellipsoid({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution);
    const Sampled sampled(solid);
    const Eigen::Isometry3d motion = motion_by(60.0, {1, 1, 1}, {1.0, 0, 0}),
                            expected = motion_by(57.0, {1, 1, 1}, {0.97, 0.01, 0});
    std::vector<Vec3> guess;
    for (const Vec3& p : sampled.particles.position) guess.push_back(expected * p);
    // All of it is in sight: nothing comes from afar.
    const auto no_crossings = []() -> const CrossingGrid& { throw std::logic_error("not needed"); };
    const auto found =
        register_to(*shapes::moved(solid, motion), no_crossings, sampled.particles, sampled.ring, guess);
    ASSERT_TRUE(found);
    EXPECT_LT(error_of(*found, sampled.particles, {motion}), 0.005);
}

TEST(Registration, LetsBodiesMoveEachInItsOwnWay) {
    const auto one = shapes::ellipsoid({-1.5, 0, 0}, {1.0, 0.7, 0.45}, kResolution),
               other = shapes::ellipsoid({1.5, 0, 0}, {0.5, 0.7, 1.0}, kResolution);
    const Sampled sampled(shapes::unite({one, other}));
    const Eigen::Isometry3d up = motion_by(0.0, {0, 0, 1}, {0, 0, 0.06}), down = up.inverse();
    const auto found = register_on(*shapes::unite({shapes::moved(one, up), shapes::moved(other, down)}),
                                   sampled, sampled.particles.position);
    ASSERT_TRUE(found);
    for (std::size_t i = 0; i < found->size(); ++i) {
        const Vec3& p = sampled.particles.position[i];
        EXPECT_LT(((*found)[i] - (p.x() < 0.0 ? up : down) * p).norm(), 0.01) << p.transpose();
    }
}

TEST(Registration, FindsALimbThatSwungBeyondTheBand) {
    // The tip goes 19 voxels, and is 8 thick; a band of 3 voxels is all that the grid knows.
    const Eigen::Isometry3d bend = support::limb_bend(0.6);
    const Sampled sampled(support::with_limb(Eigen::Isometry3d::Identity(), kResolution), 0.06);
    const LevelSet bent(rasterise(*support::with_limb(bend, kResolution), kResolution));
    const auto& at = sampled.particles.position;
    const auto found = register_on(bent, sampled, at);
    ASSERT_TRUE(found);
    std::size_t on_limb = 0, followed = 0;
    for (std::size_t i = 0; i < at.size(); ++i) {
        if (at[i].x() < 0.3) {
            EXPECT_LT(((*found)[i] - at[i]).norm(), 0.5 * kResolution) << "on the body, which rests";
        } else if (at[i].x() > 1.2) {
            ++on_limb;
            followed += ((*found)[i] - bend * at[i]).norm() < 2.0 * kResolution;
        }
    }
    EXPECT_GT(on_limb, 100u);
    EXPECT_GT(static_cast<double>(followed), 0.95 * static_cast<double>(on_limb));

    for (const std::size_t threads : {1, 3}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        EXPECT_EQ(register_on(bent, sampled, at), found) << threads << " threads";
    }
}

TEST(Registration, DoesNotTakeADropForOneThatIsFarFromIt) {
    // One drop vanishes and another appears, beside a body that moves by a voxel.
    const auto body_at = [](double y) { return shapes::box({0, y, 0}, {0.8, 0.6, 0.5}, kResolution); };
    const auto drop_at = [](double x) { return shapes::sphere({x, 0, 0}, 0.2, kResolution); };
    const Sampled sampled(shapes::unite({body_at(0), drop_at(1.5)}));
    const Vec3 step(0, kResolution, 0);
    const LevelSet next(rasterise(*shapes::unite({body_at(step.y()), drop_at(2.7)}), kResolution));
    const auto& at = sampled.particles.position;
    const auto found = register_on(next, sampled, at);
    ASSERT_TRUE(found);
    for (std::size_t i = 0; i < at.size(); ++i) {
        if (at[i].x() > 1.0) {
            EXPECT_LT(((*found)[i] - at[i]).norm(), 2.0 * kResolution) << "the drop";
        } else {
            EXPECT_LT(((*found)[i] - at[i] - step).norm(), 0.2 * kResolution) << "the body";
        }
    }
}

TEST(Registration, SaysThatNothingMoved) {
    const auto solid = shapes::ellipsoid({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution);
    const Sampled sampled(solid);
    EXPECT_FALSE(register_on(*solid, sampled, sampled.particles.position));
}

TEST(Registration, HasNoAnswerWithoutASurfaceNear) {
    const auto solid = shapes::sphere({0, 0, 0}, 1.0, kResolution);
    const Sampled sampled(solid);
    // Everything faces the other way: nothing of it is that surface.
    Sampled turned = sampled;
    for (Vec3& n : turned.particles.normal) n = -n;
    EXPECT_FALSE(
        register_on(*shapes::sphere({0.05, 0, 0}, 1.0, kResolution), turned, turned.particles.position));
}

}  // namespace
}  // namespace isotrack
