#include "isotrack/io/sample_sequence.h"

#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetMeasure.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "isotrack/error.h"
#include "isotrack/types.h"
#include "support/voxel_topology.h"

namespace isotrack {
namespace {

using testing::voxel_components;

std::vector<SampleFrame> all_frames(const std::string& shape, int frames, double voxel,
                                    std::uint64_t seed = 1) {
    SampleSequenceOptions options;
    options.frames = frames;
    options.voxel = voxel;
    options.seed = seed;
    SampleSequence sequence(shape, options);
    std::vector<SampleFrame> result;
    for (int i = 0; i < sequence.size(); ++i) result.push_back(sequence.next());
    return result;
}

std::vector<std::size_t> components(const std::vector<SampleFrame>& frames) {
    std::vector<std::size_t> counts;
    for (const SampleFrame& frame : frames) counts.push_back(voxel_components(*frame.surface).inside);
    return counts;
}

Vec3 world(const openvdb::FloatGrid& grid, const openvdb::Coord& ijk) {
    const openvdb::Vec3d p = grid.indexToWorld(ijk);
    return {p.x(), p.y(), p.z()};
}

/// Central differences at a voxel, where all six neighbours are in the band; else zero.
Vec3 gradient_at(const openvdb::FloatGrid& grid, const openvdb::Coord& ijk) {
    auto access = grid.getConstAccessor();
    Vec3 gradient;
    for (int i = 0; i < 3; ++i) {
        openvdb::Coord low = ijk, high = ijk;
        --low[i], ++high[i];
        if (!access.isValueOn(low) || !access.isValueOn(high)) return Vec3::Zero();
        gradient[i] = (access.getValue(high) - access.getValue(low)) / (2.0 * grid.voxelSize().x());
    }
    return gradient;
}

TEST(SampleSequence, EveryShapeGivesNamedLevelSetsOfHalfWidthThree) {
    for (const SampleShape& shape : sample_shapes()) {
        SCOPED_TRACE(shape.name);
        EXPECT_FALSE(shape.description.empty());
        EXPECT_EQ(shape.description.find('\n'), std::string::npos);
        for (const SampleFrame& frame : all_frames(shape.name, 2, 0.02)) {
            const openvdb::FloatGrid& grid = *frame.surface;
            EXPECT_EQ(grid.getName(), "surface");
            EXPECT_EQ(grid.getGridClass(), openvdb::GRID_LEVEL_SET);
            EXPECT_NEAR(grid.voxelSize().x(), 0.02, 1e-12);
            EXPECT_NEAR(grid.background(), 0.06, 1e-6);
            EXPECT_GT(grid.activeVoxelCount(), 500u);
            EXPECT_LT(grid.tree().getValue({1000, 1000, 1000}), 1.0f);
            EXPECT_GT(grid.tree().getValue({1000, 1000, 1000}), 0.0f);
            for (auto voxel = grid.cbeginValueOn(); voxel; ++voxel)
                ASSERT_LE(std::abs(*voxel), grid.background() * (1 + 1e-6)) << voxel.getCoord();
            if (!frame.velocity) continue;
            EXPECT_EQ(frame.velocity->getName(), "velocity");
            EXPECT_EQ(frame.velocity->activeVoxelCount(), grid.activeVoxelCount());
            EXPECT_TRUE(frame.velocity->tree().hasSameTopology(grid.tree()));
        }
    }
}

TEST(SampleSequence, FormulaShapesAreDistances) {
    // A distance has a gradient of length 1 off the medial axis, and differences err by the curvature and, at
    // edges, the kinks: so most voxels, not all.
    for (const std::string shape :
         {"sphere", "ellipsoid", "torus", "plate", "shell", "box", "blobs", "birth"}) {
        const SampleFrame frame = all_frames(shape, 3, 0.01)[1];
        std::size_t tested = 0, unit = 0;
        for (auto voxel = frame.surface->cbeginValueOn(); voxel; ++voxel) {
            const Vec3 gradient = gradient_at(*frame.surface, voxel.getCoord());
            if (gradient.isZero()) continue;
            ++tested;
            unit += std::abs(gradient.norm() - 1.0) < 0.03;
            EXPECT_LT(gradient.cwiseAbs().maxCoeff(), 1.0 + 1e-4) << shape;
        }
        EXPECT_GT(tested, 1000u) << shape;
        EXPECT_GT(static_cast<double>(unit), 0.8 * static_cast<double>(tested)) << shape;
    }
}

TEST(SampleSequence, SphereFollowsItsFormula) {
    const auto frames = all_frames("sphere", 5, 0.01);
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const double time = 0.25 * static_cast<double>(i);
        const Vec3 centre(0.35 + 0.3 * time, 0.5, 0.5);
        for (auto voxel = frames[i].surface->cbeginValueOn(); voxel; ++voxel)
            ASSERT_NEAR(*voxel, (world(*frames[i].surface, voxel.getCoord()) - centre).norm() - 0.2, 1e-6);
    }
}

TEST(SampleSequence, VelocityCarriesTheSurfaceToTheNextFrame) {
    // With many frames the step is short: what remains is the change of velocity within it, and the voxels'
    // resolution.
    for (const std::string shape :
         {"sphere", "ellipsoid", "torus", "plate", "shell", "box", "birth", "enright"}) {
        SCOPED_TRACE(shape);
        constexpr int kFrames = 401;
        constexpr double kVoxel = 0.01;
        SampleSequenceOptions options;
        options.frames = kFrames;
        options.voxel = kVoxel;
        SampleSequence sequence(shape, options);
        SampleFrame before = sequence.next(), after = sequence.next();
        double worst = 0.0, farthest = 0.0;
        auto next = after.surface->getConstAccessor();
        auto velocity = before.velocity->getConstAccessor();
        for (auto voxel = before.surface->cbeginValueOn(); voxel; ++voxel) {
            const openvdb::Coord ijk = voxel.getCoord();
            const Vec3 gradient = gradient_at(*before.surface, ijk);
            if (std::abs(*voxel) > kVoxel || std::abs(gradient.norm() - 1.0) > 0.03 || !next.isValueOn(ijk))
                continue;
            const openvdb::Vec3s v = velocity.getValue(ijk);
            const double forecast = *voxel - gradient.dot(Vec3(v.x(), v.y(), v.z()));
            worst = std::max(worst, std::abs(forecast - next.getValue(ijk)));
            farthest = std::max(farthest, static_cast<double>(v.length()));
        }
        EXPECT_GT(farthest, 1e-4);
        EXPECT_LT(worst, 0.1 * kVoxel);
        EXPECT_LT(worst, 0.5 * farthest);
    }
}

TEST(SampleSequence, BlobsMergeAndSplit) {
    const auto counts = components(all_frames("blobs", 12, 0.02));
    EXPECT_EQ(counts, (std::vector<std::size_t>{2, 2, 2, 2, 1, 1, 1, 1, 2, 2, 2, 2}));
}

TEST(SampleSequence, BirthAddsADropHalfway) {
    const auto counts = components(all_frames("birth", 8, 0.02));
    EXPECT_EQ(counts, (std::vector<std::size_t>{1, 1, 1, 1, 2, 2, 2, 2}));
}

TEST(SampleSequence, SplashThrowsUpDropsAndIsCalmAgain) {
    const auto frames = all_frames("splash", 7, 0.01);
    const auto counts = components(frames);
    EXPECT_EQ(counts.front(), 1u);
    EXPECT_EQ(counts.back(), 1u);
    EXPECT_GT(counts[3], 100u);
    ASSERT_TRUE(frames[3].velocity);
    std::size_t moving = 0, still = 0;
    for (auto voxel = frames[3].velocity->cbeginValueOn(); voxel; ++voxel)
        ++(voxel->lengthSqr() > 0.0f ? moving : still);
    EXPECT_GT(moving, 1000u);
    EXPECT_GT(still, 1000u);
}

TEST(SampleSequence, TopologyOfTheOtherShapesStays) {
    for (const std::string shape : {"sphere", "ellipsoid", "torus", "plate", "box"})
        for (const SampleFrame& frame : all_frames(shape, 4, 0.02)) {
            EXPECT_EQ(voxel_components(*frame.surface).inside, 1u) << shape;
            EXPECT_EQ(voxel_components(*frame.surface).outside, 1u) << shape;
        }
    for (const SampleFrame& frame : all_frames("shell", 4, 0.02)) {
        EXPECT_EQ(voxel_components(*frame.surface).inside, 1u);
        EXPECT_EQ(voxel_components(*frame.surface).outside, 2u);
    }
}

TEST(SampleSequence, EnrightKeepsItsVolume) {
    const double volume = 4.0 / 3.0 * 3.14159265358979323846 * std::pow(0.15, 3);
    const auto frames = all_frames("enright", 3, 0.0125);
    for (const SampleFrame& frame : frames)
        EXPECT_NEAR(openvdb::tools::levelSetVolume(*frame.surface), volume, 0.05 * volume);
    EXPECT_GT(openvdb::tools::levelSetArea(*frames.back().surface),
              1.5 * openvdb::tools::levelSetArea(*frames[0].surface));
}

TEST(SampleSequence, SameSeedSameValuesAtAnyThreadCount) {
    for (const std::string shape : {"blobs", "birth", "enright", "splash"}) {
        SCOPED_TRACE(shape);
        std::vector<SampleFrame> one, many;
        {
            tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
            one = all_frames(shape, 3, 0.02);
        }
        {
            tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
            many = all_frames(shape, 3, 0.02);
        }
        for (std::size_t i = 0; i < one.size(); ++i) {
            ASSERT_TRUE(one[i].surface->tree().hasSameTopology(many[i].surface->tree()));
            auto other = many[i].surface->getConstAccessor();
            for (auto voxel = one[i].surface->cbeginValueAll(); voxel; ++voxel)
                ASSERT_EQ(*voxel, other.getValue(voxel.getCoord()));
            if (!one[i].velocity) continue;
            auto velocity = many[i].velocity->getConstAccessor();
            for (auto voxel = one[i].velocity->cbeginValueOn(); voxel; ++voxel)
                ASSERT_EQ(*voxel, velocity.getValue(voxel.getCoord()));
        }
    }
}

TEST(SampleSequence, AnotherSeedThrowsOtherDrops) {
    const auto first = all_frames("splash", 3, 0.02, 1)[1], second = all_frames("splash", 3, 0.02, 2)[1];
    EXPECT_NE(first.surface->activeVoxelCount(), second.surface->activeVoxelCount());
}

TEST(SampleSequence, EndsAfterItsFrames) {
    SampleSequenceOptions options;
    options.frames = 1;
    SampleSequence sequence("sphere", options);
    EXPECT_EQ(sequence.size(), 1);
    sequence.next();
    EXPECT_THROW(sequence.next(), std::out_of_range);
}

TEST(SampleSequence, RefusesWhatItDoesNotKnow) {
    try {
        SampleSequence sequence("teapot");
        FAIL();
    } catch (const OptionError& error) {
        for (const SampleShape& shape : sample_shapes())
            EXPECT_NE(std::string(error.what()).find(shape.name), std::string::npos) << error.what();
    }
    SampleSequenceOptions options;
    options.frames = 0;
    EXPECT_THROW(SampleSequence("sphere", options), OptionError);
    options.frames = 1;
    for (const double voxel : {0.0, -0.01, 0.5, 1e-6, std::numeric_limits<double>::quiet_NaN()}) {
        options.voxel = voxel;
        EXPECT_THROW(SampleSequence("sphere", options), OptionError) << voxel;
    }
}

}  // namespace
}  // namespace isotrack
