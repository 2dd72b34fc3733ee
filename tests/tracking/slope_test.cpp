// Level sets whose values are not quite distances: what is held to the tolerance are distances.
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/ValueTransformer.h>

#include <memory>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/shapes.h"
#include "tracking/failing.h"
#include "tracking/inspection.h"

namespace isotrack {
namespace {

constexpr double kRadius = 1.0, kVoxel = 0.02, kTolerance = 0.01;

/// A ball whose values are that share of the distances.
openvdb::FloatGrid::Ptr ball(float share) {
    const auto grid = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(
        static_cast<float>(kRadius), openvdb::Vec3f(0.0f), static_cast<float>(kVoxel), 3.0f);
    openvdb::tools::foreach (grid->beginValueAll(), [=](const openvdb::FloatGrid::ValueAllIter& value) {
        value.setValue(share * *value);
    });
    return grid;
}

TEST(Slope, IsThatOfValuesToDistances) {
    EXPECT_NEAR(LevelSet(ball(1.0f)).slope(), 1.0, 0.01);
    EXPECT_NEAR(LevelSet(ball(0.8f)).slope(), 0.8, 0.01);
    EXPECT_NEAR(LevelSet(ball(0.6f)).slope(), 0.6, 0.01);
}

TEST(Slope, OfAMovedOrJoinedSurfaceIsItsOwn) {
    const auto whole = std::make_shared<LevelSet>(ball(1.0f)), low = std::make_shared<LevelSet>(ball(0.8f));
    const auto moved = shapes::moved(low, Eigen::Isometry3d(Eigen::Translation3d(3.0, 0.0, 0.0)));
    EXPECT_EQ(moved->slope(), low->slope());
    EXPECT_EQ(shapes::unite({whole, moved})->slope(), low->slope());
}

TEST(Slope, ValuesAreHeldToWhatKeepsDistancesWithinTheTolerance) {
    TrackerOptions options;
    options.tolerance = kTolerance;
    for (const float share : {1.0f, 0.8f, 0.6f, 0.5f}) {
        const double held_to = kCertified * sizing_limits(options, LevelSet(ball(share))).tolerance;
        EXPECT_LE(held_to / share, 1.002 * kTolerance);  // the slope is measured
        EXPECT_GE(held_to / share, 0.95 * kTolerance);
    }
}

TEST(Slope, ReportsDistances) {
    // A triangle of whose values 0.01 is the largest.
    FrameMesh mesh;
    mesh.vertices = {Vec3(0, 0, 1), Vec3(0.1, 0, 1), Vec3(0, 0.1, 1)};
    mesh.carved.triangles = {{0, 1, 2}};
    Inspection inspection;
    inspection.errors =
        std::make_shared<std::vector<FacetError>>(1, TriangleError{0.01, 0.006 * 0.006, Vec3::Zero(), 0.0});
    for (const float share : {1.0f, 0.8f, 0.5f}) {
        TrackedFrame frame;
        frame.tolerance = 0.015;
        report(mesh, inspection, LevelSet(ball(share)), frame);
        EXPECT_NEAR(frame.max_error, 0.01 / share, 0.01 * frame.max_error);
        EXPECT_NEAR(frame.rms_error, 0.006 / share, 0.01 * frame.rms_error);
        EXPECT_EQ(frame.within_tolerance, 0.01 / share < frame.tolerance);
    }
}

}  // namespace
}  // namespace isotrack
