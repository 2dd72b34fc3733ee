#include "isotrack/tracking/mesh_sequence.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <filesystem>
#include <fstream>

#include "isotrack/error.h"
#include "isotrack/io/mesh_file.h"
#include "isotrack/io/sample_sequence.h"
#include "isotrack/meshing/mesh_topology.h"

namespace isotrack {
namespace {

namespace fs = std::filesystem;

/// Four frames of a moving sphere in a folder of the test's own.
class MeshSequence : public testing::Test {
protected:
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        folder_ = fs::temp_directory_path() / (std::string("isotrack_mesh_sequence_") + info->name());
        fs::remove_all(folder_);
        fs::create_directories(folder_);
        SampleSequenceOptions options;
        options.frames = 4;
        options.voxel = 0.1;
        SampleSequence sphere("sphere", options);
        for (int frame = 1; frame <= sphere.size(); ++frame) write(frame, sphere.next().surface);
    }
    void TearDown() override { fs::remove_all(folder_); }

    void write(int frame, const openvdb::GridBase::Ptr& grid) const {
        openvdb::GridPtrVec grids;
        grids.push_back(grid);
        openvdb::io::File(expand_pattern(in("s.####.vdb"), frame)).write(grids);
    }
    std::string in(const std::string& name) const { return (folder_ / name).string(); }
    InputSequence frames() const { return find_frames({in("s.####.vdb")}); }
    RunReport run(const MeshSequenceOptions& options = {}) const {
        return mesh_sequence(frames(), in("m.####.ply"), options);
    }

    fs::path folder_;
};

TEST_F(MeshSequence, WritesOneSoundMeshPerFrameAndARowForEach) {
    const RunReport report = run();
    ASSERT_EQ(report.frames.size(), 4u);
    EXPECT_EQ(exit_code(report), 0);
    for (int frame = 1; frame <= 4; ++frame) {
        const FrameReport& row = report.frames[frame - 1];
        const TriangleMesh mesh = read_mesh(expand_pattern(in("m.####.ply"), frame));
        const MeshTopology topology = mesh_topology(mesh);
        EXPECT_EQ(row.frame, frame);
        EXPECT_EQ(row.status, "ok");
        EXPECT_EQ(mesh.triangles.size(), row.triangles);
        EXPECT_EQ(mesh.ids.size(), mesh.points.size());
        EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
        EXPECT_EQ(topology.euler, 2);
        EXPECT_LE(row.max_error_vx, 0.5);
    }
}

TEST_F(MeshSequence, GoesOnAfterAFrameItCannotUse) {
    std::ofstream(in("s.0002.vdb")) << "not a grid at all";
    const RunReport report = run();
    ASSERT_EQ(report.frames.size(), 4u);
    EXPECT_EQ(report.frames[1].status, "failed");
    EXPECT_NE(report.frames[1].message.find("s.0002.vdb"), std::string::npos);
    EXPECT_EQ(report.frames[1].message.find('\n'), std::string::npos);
    EXPECT_FALSE(fs::exists(in("m.0002.ply")));
    for (const int frame : {1, 3, 4}) EXPECT_TRUE(fs::exists(expand_pattern(in("m.####.ply"), frame)));
    EXPECT_EQ(exit_code(report), 3);

    MeshSequenceOptions stop;
    stop.on_existing = OnExisting::Overwrite;
    stop.on_error = OnError::Stop;
    EXPECT_EQ(run(stop).frames.size(), 2u);
}

TEST_F(MeshSequence, FailsWhenNoFrameCanBeUsed) {
    for (int frame = 1; frame <= 4; ++frame)
        std::ofstream(expand_pattern(in("s.####.vdb"), frame)) << "nothing";
    EXPECT_EQ(exit_code(run()), 1);
}

TEST_F(MeshSequence, WritesAnEmptyMeshForAnEmptyFrame) {
    auto empty = openvdb::FloatGrid::create(0.3f);
    empty->setGridClass(openvdb::GRID_LEVEL_SET);
    empty->setName("surface");
    empty->setTransform(openvdb::math::Transform::createLinearTransform(0.1));
    write(2, empty);
    const RunReport report = run();
    EXPECT_EQ(report.frames[1].status, "empty");
    EXPECT_TRUE(read_mesh(in("m.0002.ply")).empty());
    EXPECT_EQ(report.frames[2].status, "ok");
    EXPECT_EQ(exit_code(report), 0);
}

TEST_F(MeshSequence, DoesNotTouchWhatExistsUnlessTold) {
    std::ofstream(in("m.0003.ply")) << "mine";
    EXPECT_THROW(run(), OptionError);
    EXPECT_FALSE(fs::exists(in("m.0001.ply")));  // refused before any work

    MeshSequenceOptions skip;
    skip.on_existing = OnExisting::Skip;
    const RunReport report = run(skip);
    EXPECT_EQ(report.frames[2].status, "skipped");
    EXPECT_EQ(fs::file_size(in("m.0003.ply")), 4u);
    EXPECT_TRUE(fs::exists(in("m.0004.ply")));
    EXPECT_EQ(exit_code(report), 0);
}

TEST_F(MeshSequence, RefusesWhatCannotWorkBeforeItStarts) {
    EXPECT_THROW(mesh_sequence(frames(), in("m.####.xyz"), {}), OptionError);
    EXPECT_THROW(mesh_sequence(frames(), in("m.ply"), {}), OptionError);
    MeshSequenceOptions gap;
    gap.on_missing = OnMissing::Stop;
    fs::remove(in("s.0003.vdb"));
    EXPECT_THROW(run(gap), OptionError);
    EXPECT_EQ(run().frames.size(), 3u);
}

TEST_F(MeshSequence, GivesVelocitiesPerSecondWithARate) {
    run();
    MeshSequenceOptions rate;
    rate.fps = 24.0;
    mesh_sequence(frames(), in("r.####.ply"), rate);
    const TriangleMesh per_frame = read_mesh(in("m.0003.ply")), per_second = read_mesh(in("r.0003.ply"));
    ASSERT_EQ(per_frame.velocities.size(), per_second.velocities.size());
    ASSERT_FALSE(per_frame.velocities.empty());
    for (std::size_t v = 0; v < per_frame.velocities.size(); ++v)
        EXPECT_LT((24.0 * per_frame.velocities[v] - per_second.velocities[v]).norm(),
                  1e-4 * (1.0 + per_second.velocities[v].norm()));
}

TEST(ParseLength, TakesVoxelsAndWorldUnitsAndNothingElse) {
    EXPECT_TRUE(parse_length("0.5vx").in_voxels);
    EXPECT_EQ(parse_length("0.5vx").value, 0.5);
    EXPECT_FALSE(parse_length("0.01").in_voxels);
    EXPECT_EQ(parse_length("2vx").in_world(0.25), 0.5);
    EXPECT_EQ(to_string(parse_length("0.5vx")), "0.5vx");
    for (const char* bad : {"", "vx", "0", "-1vx", "nan", "inf", "1 vx", "1mm", "0.5vxx"})
        EXPECT_THROW(parse_length(bad), OptionError) << bad;
}

}  // namespace
}  // namespace isotrack
