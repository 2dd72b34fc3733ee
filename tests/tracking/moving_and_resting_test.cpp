// Surfaces that move along themselves or not at all, of which the tracker is told nothing.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/tracker.h"
#include "support/limb.h"
#include "support/tracked.h"

namespace isotrack {
namespace {

using shapes::SurfacePtr;
using support::kVoxel;
using support::with_tolerance;

TEST(MovingAndResting, GivesTheMotionAlongTheSurfaceAsVelocity) {
    // Nobody tells how it moves, and most of it moves along itself.
    const auto solid = shapes::ellipsoid({0, 0, 0}, {0.6, 0.42, 0.27}, kVoxel);
    const Eigen::AngleAxisd turn(0.06, Vec3(0.2, 0.3, 1.0).normalized());
    Eigen::Isometry3d place = Eigen::Isometry3d::Identity(), before = place;
    Tracker tracker(with_tolerance(0.005));
    for (int f = 0; f < 6; ++f) {
        const TrackedFrame frame = tracker.advance(*shapes::moved(solid, place));
        if (f > 0) {
            double sum = 0.0, moved = 0.0;
            for (std::size_t v = 0; v < frame.mesh.points.size(); ++v) {
                const Vec3& p = frame.mesh.points[v];
                const Vec3 truth = p - before * place.inverse() * p;
                sum += (frame.mesh.velocities[v] - truth).norm();
                moved += truth.norm();
            }
            EXPECT_LT(sum, 0.05 * moved) << "frame " << f;
        }
        before = place;
        place = turn * place;
    }
}

TEST(MovingAndResting, LetsOneTurnBesideAnotherThatRests) {
    // Most particles are on the one that rests.
    const auto rests = shapes::box({-0.7, 0, 0}, {0.5, 0.5, 0.5}, kVoxel);
    const auto turns = shapes::ellipsoid({0, 0, 0}, {0.4, 0.28, 0.18}, kVoxel);
    Tracker tracker(with_tolerance(0.25 * kVoxel));
    Eigen::Isometry3d place(Eigen::Translation3d(0.6, 0, 0)), before = place;
    for (int f = 0; f < 5; ++f) {
        const LevelSet level_set(rasterise(*shapes::unite({rests, shapes::moved(turns, place)}), kVoxel));
        const TrackedFrame frame = tracker.advance(level_set);
        double off = 0.0, moved = 0.0;
        std::size_t resting = 0, still = 0;
        for (std::size_t v = 0; v < frame.mesh.points.size(); ++v) {
            const Vec3 &p = frame.mesh.points[v], &velocity = frame.mesh.velocities[v];
            if (p.x() > 0.0) {
                const Vec3 truth = p - before * place.inverse() * p;
                off += (velocity - truth).norm();
                moved += truth.norm();
            } else {
                ++resting;
                still += velocity.norm() < 0.02 * kVoxel;
            }
        }
        if (f > 0) {
            EXPECT_LT(off, 0.15 * moved) << f;  // it is five voxels thin
            EXPECT_GT(resting, 100u);
            EXPECT_GE(static_cast<double>(still), 0.95 * static_cast<double>(resting)) << f;
        }
        before = place;
        place = place * Eigen::AngleAxisd(0.05, Vec3(0.2, 0.3, 1.0).normalized());
    }
}

TEST(MovingAndResting, FollowsALimbThatSwingsFartherThanItIsThick) {
    // To and fro by some 20 voxels at its tip, which is 8 voxels thick: nothing goes on as it went, and the
    // band of the grid ends 3 voxels from the surface.
    for (const std::uint64_t seed : {1, 2, 3, 4}) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        TrackerOptions options = with_tolerance(0.2 * kVoxel);
        options.seed = seed;
        Tracker tracker(options);
        Eigen::Isometry3d before = Eigen::Isometry3d::Identity();
        std::size_t seen = 0, lost = 0, all_resting = 0;
        double all_crept = 0.0;
        for (int f = 0; f < 6; ++f) {
            const Eigen::Isometry3d bend = support::limb_bend(f % 2 == 0 ? 0.0 : 0.6);
            const LevelSet level_set(rasterise(*support::with_limb(bend, kVoxel), kVoxel));
            const TrackedFrame frame = tracker.advance(level_set);
            support::expect_sound(frame, 1, 2, "frame " + std::to_string(f));
            const bool follows = f > 0;
            double off = 0.0, moved = 0.0, crept = 0.0;
            std::size_t resting = 0;
            for (std::size_t v = 0; follows && v < frame.mesh.points.size(); ++v) {
                const Vec3 &p = frame.mesh.points[v], &velocity = frame.mesh.velocities[v];
                const Vec3 at_rest = bend.inverse() * p;
                if (at_rest.x() > 1.0) {
                    const Vec3 truth = p - before * at_rest;
                    off += (velocity - truth).norm();
                    moved += truth.norm();
                } else if (p.x() < 0.0) {
                    ++resting;
                    crept += velocity.norm();
                }
            }
            if (follows) {
                EXPECT_LT(off, 0.15 * moved) << f;
                EXPECT_GT(resting, 100u) << f;
                EXPECT_LT(crept, 0.5 * kVoxel * static_cast<double>(resting)) << f;
                all_resting += resting;
                all_crept += crept;
                seen += frame.particles;
                lost += frame.lost;
            }
            before = bend;
        }
        EXPECT_LT(all_crept, 0.25 * kVoxel * static_cast<double>(all_resting));
        EXPECT_LT(static_cast<double>(lost), 0.02 * static_cast<double>(seen));
    }
}

TEST(MovingAndResting, RestsWhereTheSurfaceRests) {
    const SurfacePtr solids[] = {shapes::torus({0.01, 0, 0}, 0.5, 0.2, kVoxel),
                                 shapes::box({0, 0.01, 0}, {0.5, 0.4, 0.3}, kVoxel)};
    for (const SurfacePtr& solid : solids) {
        const LevelSet level_set(rasterise(*solid, kVoxel));
        Tracker tracker(with_tolerance(0.5 * kVoxel));
        TrackedFrame before;
        for (int f = 0; f < 12; ++f) {
            TrackedFrame frame = tracker.advance(level_set);
            EXPECT_TRUE(frame.within_tolerance);
            if (f >= 6) {
                EXPECT_EQ(frame.rebuilt, 0u) << f;
                EXPECT_LE(static_cast<double>(frame.born + frame.died),
                          0.02 * static_cast<double>(frame.particles));
                std::map<Id, Vec3> was;
                for (std::size_t v = 0; v < before.mesh.ids.size(); ++v)
                    was[before.mesh.ids[v]] = before.mesh.points[v];
                std::size_t at_rest = 0;
                for (std::size_t v = 0; v < frame.mesh.ids.size(); ++v) {
                    const auto found = was.find(frame.mesh.ids[v]);
                    at_rest += found != was.end() && found->second == frame.mesh.points[v];
                }
                EXPECT_GE(static_cast<double>(at_rest), 0.95 * static_cast<double>(frame.mesh.ids.size()))
                    << f;
            }
            before = std::move(frame);
        }
    }
}

TEST(MovingAndResting, NeedsHardlyMoreTrianglesThanFromTheStartAfterManyFrames) {
    const auto solid = shapes::box({0, 0, 0}, {0.5, 0.4, 0.3}, kVoxel);
    Tracker tracker(with_tolerance(0.5 * kVoxel));
    for (int f = 0;; ++f) {
        const Eigen::Isometry3d place(Eigen::AngleAxisd(0.05 * f, Vec3(1, 2, 3).normalized()));
        const LevelSet level_set(rasterise(*shapes::moved(solid, place), kVoxel));
        const TrackedFrame frame = tracker.advance(level_set);
        EXPECT_TRUE(frame.within_tolerance) << f;
        EXPECT_GE(frame.rebuilt, 1u) << f;
        if (f < 12) continue;
        Tracker anew(with_tolerance(0.5 * kVoxel));
        EXPECT_LT(static_cast<double>(frame.mesh.triangles.size()),
                  1.25 * static_cast<double>(anew.advance(level_set).mesh.triangles.size()));
        break;
    }
}

}  // namespace
}  // namespace isotrack
