// From files to files: what is written, what is said of it, and what happens to frames that are no good.
#include "isotrack/tracking/mesh_sequence.h"

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <tbb/global_control.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "isotrack/error.h"
#include "isotrack/io/mesh_file.h"
#include "isotrack/io/sample_sequence.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "support/process_memory.h"
#include "support/temp_folder.h"

namespace isotrack {
namespace {

namespace fs = std::filesystem;
using support::TempFolder;
constexpr double kVoxel = 0.04;

void write_grids(const std::string& path, const openvdb::GridBase::Ptr& first,
                 const openvdb::GridBase::Ptr& second = nullptr) {
    openvdb::GridPtrVec grids;
    grids.push_back(first);
    if (second) grids.push_back(second);
    openvdb::io::File file(path);
    file.write(grids);
    file.close();
}

openvdb::FloatGrid::Ptr surface_grid(const Surface& surface, double voxel = kVoxel) {
    const auto grid = rasterise(surface, voxel);
    grid->setName("surface");
    return grid;
}

openvdb::FloatGrid::Ptr empty_grid(double voxel) {
    const auto grid = openvdb::FloatGrid::create(static_cast<float>(3.0 * voxel));
    grid->setName("surface");
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
    return grid;
}

/// A temporary folder with frames 1 to n of a sphere of radius 0.3 that moves by `step` from one to the next.
struct MovingSphere {
    static inline const Vec3 step{0.5 * kVoxel, 0, 0};
    TempFolder folder;

    explicit MovingSphere(int frames, bool with_velocity = false) {
        for (int f = 1; f <= frames; ++f) {
            openvdb::Vec3SGrid::Ptr velocity;
            if (with_velocity) {
                const openvdb::Vec3s v(static_cast<float>(step.x()), 0.0f, 0.0f);
                velocity = openvdb::Vec3SGrid::create(v);  // the same everywhere
                velocity->setName("velocity");
                velocity->setTransform(openvdb::math::Transform::createLinearTransform(kVoxel));
                velocity->tree().setValue(openvdb::Coord(0), v);
            }
            write_grids(in(f), surface_grid(*shapes::sphere(centre(f), 0.3, kVoxel)), velocity);
        }
    }
    static Vec3 centre(int f) { return {0.5 + f * step.x(), 0.5, 0.5}; }
    std::string in(int f) const { return folder.file("in." + std::to_string(f) + ".vdb"); }
    std::string out(int f) const { return folder.file("out." + std::to_string(f) + ".ply"); }
    std::string pattern() const { return folder.file("out.#.ply"); }
    InputSequence input() const { return find_frames({folder.file("in.#.vdb")}); }
    std::vector<int> written(int frames) const {
        std::vector<int> result;
        for (int f = 1; f <= frames; ++f)
            if (fs::exists(out(f))) result.push_back(f);
        return result;
    }
};

std::vector<std::string> status_of(const RunReport& report) {
    std::vector<std::string> result;
    for (const FrameReport& row : report.frames) result.push_back(row.status);
    return result;
}

using Words = std::vector<std::string>;
using Numbers = std::vector<int>;

TEST(ParseLength, TakesVoxelsAndWorldUnits) {
    const Length voxels = parse_length("0.5vx"), world = parse_length("0.01"), small = parse_length("2.5e-3");
    EXPECT_TRUE(voxels.in_voxels);
    EXPECT_EQ(voxels.value, 0.5);
    EXPECT_EQ(voxels.in_world(0.02), 0.01);
    EXPECT_FALSE(world.in_voxels);
    EXPECT_EQ(world.in_world(123.0), 0.01);
    EXPECT_EQ(small.value, 2.5e-3);
    EXPECT_EQ(to_string(voxels), "0.5vx");
    EXPECT_EQ(to_string(world), "0.01");
    for (const char* text : {"0.25vx", "3", "1e-05"}) {
        const Length length = parse_length(text), again = parse_length(to_string(length));
        EXPECT_EQ(again.value, length.value);
        EXPECT_EQ(again.in_voxels, length.in_voxels);
    }
}

TEST(ParseLength, RefusesEverythingElse) {
    for (const char* text : {"", "vx", "0", "-1", "0vx", "-0.5vx", "nan", "inf", "infvx", "1m", "1 vx ",
                             "1,5", "0.5%", "abc", "1e999"})
        EXPECT_THROW(parse_length(text), OptionError) << text;
}

TEST(MeshSequence, WritesOneGoodMeshPerFrame) {
    const MovingSphere data(4);
    int started = 0;
    std::vector<int> finished;
    MeshSequenceEvents events;
    events.started = [&](const RunReport& report) {
        ++started;
        EXPECT_TRUE(finished.empty());
        EXPECT_EQ(report.settings.count("tolerance"), 1u);
    };
    events.finished = [&](const FrameReport& row) {
        finished.push_back(row.frame);
        EXPECT_TRUE(fs::exists(row.output));
    };
    const RunReport report = mesh_sequence(data.input(), data.pattern(), {}, events);
    EXPECT_EQ(started, 1);
    EXPECT_EQ(finished, (Numbers{1, 2, 3, 4}));
    EXPECT_EQ(exit_code(report), 0);
    ASSERT_EQ(report.frames.size(), 4u);
    for (int f = 1; f <= 4; ++f) {
        const FrameReport& row = report.frames[f - 1];
        EXPECT_EQ(row.frame, f);
        EXPECT_EQ(row.time, f);
        EXPECT_EQ(row.input, data.in(f));
        EXPECT_EQ(row.output, data.out(f));
        EXPECT_EQ(row.grid, "surface");
        EXPECT_EQ(row.status, "ok") << row.message;
        EXPECT_NEAR(row.voxel_size, kVoxel, 1e-12);
        EXPECT_LE(row.max_error_vx, 0.5);
        EXPECT_TRUE(row.closed && row.manifold);
        EXPECT_EQ(row.components, 1u);
        EXPECT_EQ(row.euler, 2);
        EXPECT_EQ(row.self_intersections, 0u);
        for (const char* stage : {"read", "open", "carry", "cover", "size", "relax", "delaunay", "convect",
                                  "certify", "write", "total"})
            EXPECT_EQ(row.seconds.count(stage), 1u) << stage;
        EXPECT_GT(row.peak_memory_mb, 0.0);

        const TriangleMesh mesh = read_mesh(data.out(f));
        EXPECT_EQ(mesh.points.size(), row.vertices);
        EXPECT_EQ(mesh.triangles.size(), row.triangles);
        EXPECT_EQ(mesh.ids.size(), row.vertices);
        EXPECT_EQ(mesh.velocities.size(), row.vertices);
        const MeshTopology t = mesh_topology(mesh);
        EXPECT_TRUE(t.closed() && t.oriented() && t.manifold());
        EXPECT_EQ(t.euler, 2);
        for (const Vec3& p : mesh.points) EXPECT_NEAR((p - data.centre(f)).norm(), 0.3, 0.05 * kVoxel);
    }
    // Most ids go on.
    const auto a = read_mesh(data.out(3)).ids, b = read_mesh(data.out(4)).ids;
    const std::set<Id> before(a.begin(), a.end());
    std::size_t kept = 0;
    for (const Id id : b) kept += before.count(id);
    EXPECT_GT(static_cast<double>(kept), 0.8 * static_cast<double>(b.size()));
}

TEST(MeshSequence, FollowsAGeneratedSequenceThatMergesAndSplits) {
    TempFolder folder;
    SampleSequenceOptions options;
    options.frames = 6;
    options.voxel = 0.03;
    SampleSequence sequence("blobs", options);
    std::vector<std::string> files;
    for (int f = 0; f < sequence.size(); ++f) {
        const SampleFrame frame = sequence.next();
        files.push_back(folder.file("blobs." + std::to_string(f) + ".vdb"));
        write_grids(files.back(), frame.surface, frame.velocity);
    }
    const RunReport report = mesh_sequence(find_frames(files), folder.file("meshes/m.####.obj"), {});
    EXPECT_EQ(exit_code(report), 0);
    ASSERT_EQ(report.frames.size(), 6u);
    std::set<std::size_t> components;
    for (const FrameReport& row : report.frames) {
        EXPECT_EQ(row.status, "ok") << row.message;
        EXPECT_EQ(row.euler, 2 * static_cast<long>(row.components));
        EXPECT_EQ(row.surface_euler, row.euler);
        components.insert(row.components);
        EXPECT_TRUE(fs::exists(row.output)) << row.output;
    }
    EXPECT_EQ(components, (std::set<std::size_t>{1, 2}));
}

TEST(MeshSequence, SaysWhenAMeshHasAnotherTopology) {
    // A reconstruction from the points alone fills the void.
    TempFolder folder;
    SampleSequence sequence("shell", {});
    write_grids(folder.file("shell.vdb"), sequence.next().surface, {});
    MeshSequenceOptions options;
    for (const Reconstruction reconstruction : {Reconstruction::Guided, Reconstruction::Pure}) {
        const bool filled = reconstruction == Reconstruction::Pure;
        options.reconstruction = reconstruction;
        options.on_existing = OnExisting::Overwrite;
        const RunReport report =
            mesh_sequence(find_frames({folder.file("shell.vdb")}), folder.file("m.ply"), options);
        ASSERT_EQ(report.frames.size(), 1u);
        const FrameReport& row = report.frames[0];
        EXPECT_EQ(row.euler, filled ? 2 : 4);
        EXPECT_EQ(row.surface_euler, 4);
        EXPECT_EQ(row.has_other_topology(), filled);
        EXPECT_EQ(row.message.find("Euler number 2, the level set's 4") != std::string::npos, filled)
            << row.message;
    }
}

TEST(MeshSequence, GivesTheSameBytesEachTime) {
    const MovingSphere data(3);
    const auto bytes = [&](const std::string& name) {
        mesh_sequence(data.input(), data.folder.file(name + ".#.ply"), {});
        std::vector<std::string> files;
        for (int f = 1; f <= 3; ++f) {
            std::ifstream in(data.folder.file(name + "." + std::to_string(f) + ".ply"), std::ios::binary);
            files.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
            EXPECT_GT(files.back().size(), 1000u);
        }
        return files;
    };
    EXPECT_EQ(bytes("a"), bytes("b"));
}

TEST(MeshSequence, HoldsTwoGridsAtOnce) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers keep freed memory back";
#endif
    const TempFolder folder;
    const auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(150.f, openvdb::Vec3f(0.f), 1.f);
    for (int f = 1; f <= 6; ++f) write_grids(folder.file("s." + std::to_string(f) + ".vdb"), grid);
    const double grid_mb = static_cast<double>(grid->memUsage()) / (1024.0 * 1024.0);
    const InputSequence input = find_frames({folder.file("s.{}.vdb")});
    MeshSequenceOptions options;
    options.tolerance = {3.0, true};  // few particles
    options.on_existing = OnExisting::Overwrite;
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 2);
    const auto peak_of = [&](const InputSequence& frames) {
        support::give_back_free_memory();
        support::reset_peak();
        const double before = support::memory_mb("VmRSS");
        if (support::memory_mb("VmHWM") > before + 0.1 * grid_mb) return 0.0;
        EXPECT_EQ(exit_code(mesh_sequence(frames, folder.file("m.{}.ply"), options)), 0);
        return support::memory_mb("VmHWM") - before;
    };
    InputSequence one = input;
    one.frames.resize(1);
    const double alone = peak_of(one), all = peak_of(input);
    if (!(alone > grid_mb && all > grid_mb)) GTEST_SKIP() << "the system does not tell the peak of memory";
    // One grid more takes 1.6 times its size with all that is made of it, two more would take 2.5.
    EXPECT_LT(all - alone, 2.1 * grid_mb);
}

TEST(MeshSequence, GoesOnAfterABadFrame) {
    const MovingSphere data(4);
    fs::resize_file(data.in(2), fs::file_size(data.in(2)) / 2);
    const RunReport report = mesh_sequence(data.input(), data.pattern(), {});
    EXPECT_EQ(status_of(report), (Words{"ok", "failed", "ok", "ok"}));
    EXPECT_EQ(data.written(4), (Numbers{1, 3, 4}));
    EXPECT_EQ(exit_code(report), 3);
    const FrameReport& bad = report.frames[1];
    EXPECT_EQ(bad.frame, 2);
    EXPECT_NE(bad.message.find(data.in(2)), std::string::npos) << bad.message;
    EXPECT_EQ(bad.message.find('\n'), std::string::npos);
    // Frame 3 is tracked on from frame 1, so what is new is few, and the velocity is still per frame.
    EXPECT_LT(static_cast<double>(report.frames[2].born),
              0.3 * static_cast<double>(report.frames[2].particles));
    const TriangleMesh mesh = read_mesh(data.out(3));
    double along = 0.0, weight = 0.0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        const Vec3 n = (mesh.points[v] - data.centre(3)).normalized();
        along += mesh.velocities[v].dot(n) * n.x();
        weight += n.x() * n.x();
    }
    EXPECT_NEAR(along / weight, data.step.x(), 0.1 * data.step.x());
}

TEST(MeshSequence, StopsAtABadFrameWhenTold) {
    const MovingSphere data(4);
    std::ofstream(data.in(2), std::ios::trunc) << "version https://git-lfs.github.com/spec/v1\n";
    MeshSequenceOptions options;
    options.on_error = OnError::Stop;
    const RunReport report = mesh_sequence(data.input(), data.pattern(), options);
    EXPECT_EQ(status_of(report), (Words{"ok", "failed"}));
    EXPECT_EQ(data.written(4), (Numbers{1}));
    EXPECT_EQ(exit_code(report), 3);
}

TEST(MeshSequence, FailsWhenNoFrameIsGood) {
    const MovingSphere data(2);
    for (const int f : {1, 2}) std::ofstream(data.in(f), std::ios::trunc) << "no VDB";
    const RunReport report = mesh_sequence(data.input(), data.pattern(), {});
    EXPECT_EQ(status_of(report), (Words{"failed", "failed"}));
    EXPECT_EQ(exit_code(report), 1);
    EXPECT_TRUE(data.written(2).empty());
}

TEST(MeshSequence, SaysThatAToleranceWasMissed) {
    const MovingSphere data(2);
    MeshSequenceOptions options;
    options.tolerance = parse_length("0.01vx");
    options.min_edge = parse_length("5vx");
    const RunReport report = mesh_sequence(data.input(), data.pattern(), options);
    EXPECT_EQ(status_of(report), (Words{"tolerance_not_met", "tolerance_not_met"}));
    EXPECT_NE(report.frames[0].message.find("tolerance 0.01"), std::string::npos) << report.frames[0].message;
    EXPECT_EQ(data.written(2), (Numbers{1, 2}));
    EXPECT_EQ(exit_code(report), 3);
}

TEST(MeshSequence, RefusesExistingOutputsBeforeAnyWork) {
    const MovingSphere data(3);
    std::ofstream(data.out(3)) << "mine";
    MeshSequenceEvents events;
    events.started = [](const RunReport&) { FAIL() << "started"; };
    EXPECT_THROW(mesh_sequence(data.input(), data.pattern(), {}, events), OptionError);
    EXPECT_EQ(data.written(3), (Numbers{3}));
    std::string content;
    std::ifstream(data.out(3)) >> content;
    EXPECT_EQ(content, "mine");

    MeshSequenceOptions options;
    options.on_existing = OnExisting::Overwrite;
    EXPECT_EQ(exit_code(mesh_sequence(data.input(), data.pattern(), options)), 0);
    EXPECT_GT(read_mesh(data.out(3)).points.size(), 30u);
}

TEST(MeshSequence, SkipsExistingOutputsWhenTold) {
    const MovingSphere data(4);
    for (const int f : {1, 3}) std::ofstream(data.out(f)) << "mine";
    MeshSequenceOptions options;
    options.on_existing = OnExisting::Skip;
    const RunReport report = mesh_sequence(data.input(), data.pattern(), options);
    EXPECT_EQ(status_of(report), (Words{"skipped", "ok", "skipped", "ok"}));
    EXPECT_EQ(exit_code(report), 0);
    EXPECT_EQ(fs::file_size(data.out(1)), 4u);
    EXPECT_EQ(fs::file_size(data.out(3)), 4u);
    EXPECT_EQ(data.written(4), (Numbers{1, 2, 3, 4}));
}

TEST(MeshSequence, PassesOverMissingFramesOrRefusesThem) {
    const MovingSphere data(4);
    fs::remove(data.in(2));
    const InputSequence input = data.input();
    ASSERT_EQ(input.missing, (Numbers{2}));
    MeshSequenceOptions options;
    options.on_missing = OnMissing::Stop;
    EXPECT_THROW(mesh_sequence(input, data.pattern(), options), OptionError);
    EXPECT_TRUE(data.written(4).empty());
    const RunReport report = mesh_sequence(input, data.pattern(), {});
    EXPECT_EQ(status_of(report), (Words{"ok", "ok", "ok"}));
    EXPECT_EQ(data.written(4), (Numbers{1, 3, 4}));
    EXPECT_EQ(exit_code(report), 0);
}

TEST(MeshSequence, WritesAnEmptyMeshForAnEmptyFrame) {
    const MovingSphere data(3);
    write_grids(data.in(2), empty_grid(kVoxel));
    const RunReport report = mesh_sequence(data.input(), data.pattern(), {});
    EXPECT_EQ(status_of(report), (Words{"ok", "empty", "ok"}));
    EXPECT_EQ(exit_code(report), 0);
    const TriangleMesh mesh = read_mesh(data.out(2));
    EXPECT_TRUE(mesh.points.empty());
    EXPECT_TRUE(mesh.triangles.empty());
    // Afterwards it starts afresh: no id of frame 1 comes back.
    const auto a = read_mesh(data.out(1)).ids, b = read_mesh(data.out(3)).ids;
    const std::set<Id> before(a.begin(), a.end());
    for (const Id id : b) EXPECT_EQ(before.count(id), 0u);
}

TEST(MeshSequence, TakesTheVoxelOfTheFirstFrameWithASurface) {
    const MovingSphere data(3);
    write_grids(data.in(1), empty_grid(1.0));
    const RunReport report = mesh_sequence(data.input(), data.pattern(), {});
    EXPECT_EQ(status_of(report), (Words{"empty", "ok", "ok"}));
    for (const int f : {2, 3}) EXPECT_LE(report.frames[f - 1].max_error_vx, 0.5);
    EXPECT_GT(report.frames[1].triangles, 60u);
    EXPECT_EQ(report.settings.at("voxel_size").substr(0, 4), "0.04");
}

TEST(MeshSequence, TakesOnlyEmptyFramesToo) {
    const MovingSphere data(2);
    for (const int f : {1, 2}) write_grids(data.in(f), empty_grid(kVoxel));
    const RunReport report = mesh_sequence(data.input(), data.pattern(), {});
    EXPECT_EQ(status_of(report), (Words{"empty", "empty"}));
    EXPECT_EQ(exit_code(report), 0);
    EXPECT_EQ(data.written(2), (Numbers{1, 2}));
}

TEST(MeshSequence, GivesVelocitiesPerFrameOrPerSecond) {
    const MovingSphere data(3, true);
    const auto mean_velocity = [&](int f) {
        Vec3 sum = Vec3::Zero();
        const TriangleMesh mesh = read_mesh(data.out(f));
        for (const Vec3& v : mesh.velocities) sum += v;
        return Vec3(sum / static_cast<double>(mesh.velocities.size()));
    };
    MeshSequenceOptions options;
    options.on_existing = OnExisting::Overwrite;
    mesh_sequence(data.input(), data.pattern(), options);
    for (const int f : {2, 3}) EXPECT_LT((mean_velocity(f) - data.step).norm(), 0.05 * data.step.norm());

    // With a rate the velocity grid is per second too: too slow by 24 here, and so no better a guess than
    // none.
    options.fps = 24.0;
    const RunReport report = mesh_sequence(data.input(), data.pattern(), options);
    EXPECT_DOUBLE_EQ(report.frames[2].time, 2.0 / 24.0);
    const TriangleMesh mesh = read_mesh(data.out(3));
    double along = 0.0, weight = 0.0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        const Vec3 n = (mesh.points[v] - data.centre(3)).normalized();
        along += mesh.velocities[v].dot(n) * n.x();
        weight += n.x() * n.x();
    }
    EXPECT_NEAR(along / weight, 24.0 * data.step.x(), 0.1 * 24.0 * data.step.x());
}

TEST(MeshSequence, CarriesPointsByTheVelocitiesOfBothFramesAcrossAGap) {
    // A ball that flies, and spins faster and faster, which its shape does not tell. Each grid knows the
    // velocities around its surface alone. Frame 1 is missing.
    const TempFolder folder;
    constexpr double kRadius = 10.0 * kVoxel, kSpin = 0.2, kFaster = 0.05;  // radians a frame
    const auto centre = [](int f) { return Vec3(10.0 * kVoxel * f, 0.0, 0.0); };
    for (const int f : {0, 2}) {
        const auto surface = surface_grid(*shapes::sphere(centre(f), kRadius, kVoxel));
        const auto velocity = openvdb::Vec3SGrid::create();
        velocity->setName("velocity");
        velocity->setTransform(surface->transform().copy());
        auto accessor = velocity->getAccessor();
        for (auto value = surface->cbeginValueOn(); value; ++value) {
            const Vec3 out = Vec3(surface->indexToWorld(value.getCoord()).asPointer()) - centre(f);
            const Vec3 way = centre(1) - centre(0),
                       v = way + (kSpin + kFaster * f) * Vec3::UnitZ().cross(out);
            accessor.setValue(value.getCoord(), openvdb::Vec3s(openvdb::Vec3d(v.data())));
        }
        write_grids(folder.file("in." + std::to_string(f) + ".vdb"), surface, velocity);
    }
    const RunReport report =
        mesh_sequence(find_frames({folder.file("in.#.vdb")}), folder.file("out.#.ply"), {});
    ASSERT_EQ(status_of(report), Words(2, "ok"));
    EXPECT_EQ(report.frames[1].lost, 0u);
    const TriangleMesh mesh = read_mesh(folder.file("out.2.ply"));
    double angles = 0.0, weights = 0.0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        const Vec3 after = mesh.points[v] - centre(2),
                   before = mesh.points[v] - 2.0 * mesh.velocities[v] - centre(0);
        const double weight = after.head<2>().squaredNorm();
        weights += weight;
        angles += weight * std::atan2(before.x() * after.y() - before.y() * after.x(),
                                      before.head<2>().dot(after.head<2>()));
    }
    const double exact = 2.0 * kSpin + 0.5 * kFaster * 4.0;
    EXPECT_NEAR(angles / weights, exact, 0.05 * exact);
}

TEST(MeshSequence, RefusesWrongRequestsBeforeAnyWork) {
    const MovingSphere data(2);
    const auto refuses = [&](const std::string& output, const MeshSequenceOptions& options = {}) {
        EXPECT_THROW(mesh_sequence(data.input(), output, options), OptionError) << output;
    };
    refuses(data.folder.file("new/out.#.xyz"));
    refuses(data.folder.file("new/out.#"));
    refuses(data.folder.file("new/out.ply"));  // one name for two frames
    MeshSequenceOptions options;
    options.fps = 0.0;
    refuses(data.folder.file("new/out.#.ply"), options);
    options = {};
    options.angle_deg = 120.0;
    refuses(data.folder.file("new/out.#.ply"), options);
    options = {};
    options.tolerance = {-1.0, true};
    refuses(data.folder.file("new/out.#.ply"), options);
    options = {};
    options.min_edge = Length{2.0, true};
    options.max_edge = Length{1.0, true};
    refuses(data.folder.file("new/out.#.ply"), options);
    EXPECT_FALSE(fs::exists(data.folder.path() / "new"));
    EXPECT_THROW(mesh_sequence({}, data.pattern(), {}), OptionError);
    // A folder below a file cannot be made.
    refuses(data.in(1) + "/out.#.ply");
}

TEST(MeshSequence, TakesOneFrameWithAPlainName) {
    const MovingSphere data(1);
    const RunReport report =
        mesh_sequence(find_frames({data.in(1)}), data.folder.file("sub/folder/mesh.off"), {});
    EXPECT_EQ(exit_code(report), 0);
    EXPECT_GT(read_mesh(data.folder.file("sub/folder/mesh.off")).points.size(), 30u);
}

TEST(MeshSequence, StopsWhenAFileCannotBeWrittenAndKeepsTheOthers) {
    const MovingSphere data(5);
    fs::create_directory(data.out(2));  // a folder where the file should go
    std::ofstream(fs::path(data.out(2)) / "content") << "mine";
    MeshSequenceOptions options;
    options.on_existing = OnExisting::Overwrite;
    const RunReport report = mesh_sequence(data.input(), data.pattern(), options);
    ASSERT_GE(report.frames.size(), 2u);
    EXPECT_LT(report.frames.size(), 5u);
    EXPECT_EQ(report.frames[0].status, "ok");
    EXPECT_EQ(report.frames[1].status, "failed");
    EXPECT_NE(report.frames[1].message.find(data.out(2)), std::string::npos) << report.frames[1].message;
    EXPECT_EQ(exit_code(report), 3);
    EXPECT_GT(read_mesh(data.out(1)).points.size(), 30u);
    EXPECT_TRUE(fs::exists(fs::path(data.out(2)) / "content"));
}

TEST(MeshSequence, NamesGridsThatAreNotThere) {
    const MovingSphere data(2);
    MeshSequenceOptions options;
    options.grid = "phi";
    const RunReport report = mesh_sequence(data.input(), data.pattern(), options);
    EXPECT_EQ(exit_code(report), 1);
    EXPECT_NE(report.frames[0].message.find("surface"), std::string::npos) << report.frames[0].message;
}

TEST(ExitCode, TellsGoodFromSomeFromNone) {
    const auto code = [](const std::vector<std::string>& all) {
        RunReport report;
        for (const std::string& status : all) {
            FrameReport row;
            row.status = status;
            report.frames.push_back(row);
        }
        return exit_code(report);
    };
    EXPECT_EQ(code({"ok", "empty", "skipped"}), 0);
    EXPECT_EQ(code({"ok", "failed"}), 3);
    EXPECT_EQ(code({"ok", "tolerance_not_met"}), 3);
    EXPECT_EQ(code({"tolerance_not_met"}), 3);
    EXPECT_EQ(code({"failed", "failed"}), 1);
    RunReport open;
    open.frames.resize(2);
    open.frames[1].closed = false;
    EXPECT_EQ(exit_code(open), 3);
}

}  // namespace
}  // namespace isotrack
