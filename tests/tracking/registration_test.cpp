// Motions that are known, found again from the surfaces alone.
#include "tracking/registration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "isotrack/meshing/convection.h"
#include "isotrack/surface/shapes.h"
#include "support/samples.h"
#include "tracking/last_mesh.h"

namespace isotrack {
namespace {

using shapes::SurfacePtr;
constexpr double kResolution = 0.05;

Eigen::Isometry3d motion_by(double degrees, const Vec3& axis, const Vec3& shift) {
    return Eigen::Translation3d(shift) *
           Eigen::AngleAxisd(degrees * 3.14159265358979 / 180.0, axis.normalized());
}

struct Sampled : support::Samples {
    Adjacency ring;

    explicit Sampled(const SurfacePtr& surface) : Samples(*surface, 0.12) {
        const CellLabels labels = guided_convection(cells, particles.position, particles.normal, *surface);
        ring = ring_of(particle_triangles(carve(cells, labels, particles.position)), particles.size());
    }
};

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
        const auto found = register_to(*shapes::moved(solids[k], motion), sampled.particles, sampled.ring,
                                       sampled.particles.position);
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
    const auto found = register_to(*shapes::moved(solid, motion), sampled.particles, sampled.ring, guess);
    ASSERT_TRUE(found);
    EXPECT_LT(error_of(*found, sampled.particles, {motion}), 0.005);
}

TEST(Registration, LetsBodiesMoveEachInItsOwnWay) {
    const auto one = shapes::ellipsoid({-1.5, 0, 0}, {1.0, 0.7, 0.45}, kResolution),
               other = shapes::ellipsoid({1.5, 0, 0}, {0.5, 0.7, 1.0}, kResolution);
    const Sampled sampled(shapes::unite({one, other}));
    const Eigen::Isometry3d up = motion_by(0.0, {0, 0, 1}, {0, 0, 0.06}), down = up.inverse();
    const auto found = register_to(*shapes::unite({shapes::moved(one, up), shapes::moved(other, down)}),
                                   sampled.particles, sampled.ring, sampled.particles.position);
    ASSERT_TRUE(found);
    for (std::size_t i = 0; i < found->size(); ++i) {
        const Vec3& p = sampled.particles.position[i];
        EXPECT_LT(((*found)[i] - (p.x() < 0.0 ? up : down) * p).norm(), 0.01) << p.transpose();
    }
}

TEST(Registration, SaysThatNothingMoved) {
    const auto solid = shapes::ellipsoid({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution);
    const Sampled sampled(solid);
    EXPECT_FALSE(register_to(*solid, sampled.particles, sampled.ring, sampled.particles.position));
}

TEST(Registration, HasNoAnswerWithoutASurfaceNear) {
    const auto solid = shapes::sphere({0, 0, 0}, 1.0, kResolution);
    const Sampled sampled(solid);
    // Everything faces the other way: nothing of it is that surface.
    Particles turned = sampled.particles;
    for (Vec3& n : turned.normal) n = -n;
    EXPECT_FALSE(
        register_to(*shapes::sphere({0.05, 0, 0}, 1.0, kResolution), turned, sampled.ring, turned.position));
}

}  // namespace
}  // namespace isotrack
