// What frames cost as grids and meshes grow. scale.sh makes tables of it.
//
//     isotrack_scale write folder --voxel 0.004 --frames 4
//     isotrack_scale track folder --tolerance 0.002 --measure 2
//     isotrack_scale files folder --tolerance 0.002
//
// The surface is a sphere with bumps that travel around it while it drifts, the same at any voxel size, or
// one without bumps.
#include <fmt/format.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "cli/table.h"
#include "isotrack/error.h"
#include "isotrack/io/sequence.h"
#include "isotrack/io/vdb_file.h"
#include "isotrack/memory.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/mesh_sequence.h"
#include "isotrack/tracking/tracker.h"
#include "support/process_memory.h"

namespace isotrack::bench {
namespace {

using support::give_back_free_memory;
using support::memory_mb;
using support::reset_peak;

using Json = nlohmann::ordered_json;

constexpr double kPi = 3.14159265358979323846;
constexpr double kRadius = 0.35, kBumps = 0.01, kWavelength = 0.1;

/// With bumps of this height.
shapes::SurfacePtr sphere(double height, int frame, double voxel) {
    constexpr double kDrift = 0.002, kTravel = 0.0025;  // per frame
    constexpr double k = 2.0 * kPi / kWavelength;
    const double steepest = 1.0 + k * height;
    // Within so many voxels the value is the distance to first order but where the slope is low, beyond them
    // never more than the distance: no block of the band may seem to be farther than its diagonal.
    constexpr double kNear = 5.0, kLowSlope = 0.6;
    const Vec3 centre(0.5 + kDrift * frame, 0.5, 0.5);
    const Vec3 phase(k * kTravel * frame, 0.0, 0.0);
    const auto value = [=](const Vec3& p) {
        const Vec3 way = p - centre;
        const Eigen::Array3d at = k * way + phase, s = at.sin(), c = at.cos();
        const double length = way.norm(), f = length - kRadius - height * s.prod();
        if (!(std::abs(f) < kNear * voxel)) return f / steepest;
        const Vec3 waves(c[0] * s[1] * s[2], s[0] * c[1] * s[2], s[0] * s[1] * c[2]);
        return f / std::max(kLowSlope, (way / length - k * height * waves).norm());
    };
    const Vec3 reach = Vec3::Constant(kRadius + height);
    return shapes::from_function(value, Box(centre - reach, centre + reach), voxel);
}

struct WriteArguments {
    std::string folder;
    double voxel = 0.0, per_diagonal = 0.0;
    int frames = 4;
    bool perfect = false;
};

int write(const WriteArguments& arguments) {
    const double height = arguments.perfect ? 0.0 : kBumps;
    const double voxel = arguments.per_diagonal > 0.0
                             ? sphere(height, 0, 1.0)->bounds().diagonal().norm() / arguments.per_diagonal
                             : arguments.voxel;
    std::filesystem::create_directories(arguments.folder);
    for (int frame = 0; frame < arguments.frames; ++frame) {
        const openvdb::FloatGrid::Ptr grid = rasterise(*sphere(height, frame, voxel), voxel);
        grid->setName("surface");
        openvdb::io::File(fmt::format("{}/frame.{:04}.vdb", arguments.folder, frame)).write({grid});
    }
    fmt::print("{}\n", voxel);
    return 0;
}

template <typename Body>
double seconds_of(const Body& body) {
    const auto start = std::chrono::steady_clock::now();
    body();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct TrackArguments {
    std::string input;
    double tolerance = 0.0;
    std::size_t measure = 2;
    int threads = 0;
    bool fit = false, peers = false;
};

double volume_to_mesh_seconds(const LevelSet& level_set, double adaptivity) {
    return seconds_of([&] {
        std::vector<openvdb::Vec3s> points;
        std::vector<openvdb::Vec3I> triangles;
        std::vector<openvdb::Vec4I> quads;
        openvdb::tools::volumeToMesh(*level_set.grid(), points, triangles, quads, 0.0, adaptivity);
    });
}

/// One row: means over the frames measured, seconds; memory is the largest of all frames.
int track(const TrackArguments& arguments) {
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    const tbb::global_control limit(
        tbb::global_control::max_allowed_parallelism,
        static_cast<std::size_t>(arguments.threads > 0 ? arguments.threads : cores));
    const std::vector<InputFrame> input = find_frames({arguments.input}).frames;
    TrackerOptions options;
    options.tolerance = arguments.tolerance;
    options.fit = arguments.fit;
    Tracker tracker(options);

    Json row{{"voxels", 0.0}, {"particles", 0.0}, {"not_kept", 0.0}, {"seeded", 0.0},
             {"read", 0.0},   {"open", 0.0},      {"advance", 0.0},  {"above_mb", 0.0}};
    double grid_mb = 0.0;  // without pages of files: the program itself, of which more is read as it runs
    const double measured = static_cast<double>(std::min(arguments.measure, input.size()));
    for (std::size_t i = 0; i < input.size(); ++i) {
        openvdb::GridBase::ConstPtr grid;
        std::unique_ptr<LevelSet> level_set;
        const double read = seconds_of([&] {
            const std::string& path = input[i].path;
            grid = read_grid(path, choose_grid(list_grids(path), {}, path));
        });
        const double open = seconds_of([&] { level_set = std::make_unique<LevelSet>(grid); });
        if (i == 0) {
            // What reading has freed would count as the grid's, though tracking takes it. Later tracking
            // would wait for its memory again: what is freed then counts as its own.
            give_back_free_memory();
            grid_mb = memory_mb("VmRSS") - memory_mb("RssFile");
        }
        reset_peak();
        TrackedFrame frame;
        const double advance = seconds_of([&] { frame = tracker.advance(*level_set); });
        row["above_mb"] =
            std::max(row["above_mb"].get<double>(), memory_mb("VmHWM") - memory_mb("RssFile") - grid_mb);
        if (i + arguments.measure < input.size()) continue;
        const auto add = [&](const std::string& name, double value) {
            row[name] = row.value(name, 0.0) + value / measured;
        };
        add("voxels", static_cast<double>(level_set->active_voxels()));
        add("particles", static_cast<double>(frame.particles));
        add("not_kept", frame.within_tolerance ? 0.0 : 1.0);
        add("seeded", static_cast<double>(frame.seeded));
        add("read", read);
        add("open", open);
        add("advance", advance);
        for (const auto& [stage, seconds] : frame.seconds) add(stage, seconds);
        if (!arguments.peers) continue;
        add("adaptive", volume_to_mesh_seconds(*level_set, 0.1));
        add("uniform", volume_to_mesh_seconds(*level_set, 0.0));
    }
    fmt::print("{}", cli::format_table(Json::array({row}), cli::TableFormat::Csv));
    return 0;
}

struct FilesArguments {
    std::string input;
    double tolerance = 0.0;
    bool fit = false;
};

/// What a file's grid takes of memory.
double grid_mb(const std::string& path) {
    return static_cast<double>(read_grid(path, choose_grid(list_grids(path), {}, path))->memUsage()) /
           (1024.0 * 1024.0);
}

/// From files to files. One row: the seconds of all together, and of each of the stages that run beside each
/// other; and the peak of memory above the program and two grids, of which one is read ahead.
int files(const FilesArguments& arguments) {
    const InputSequence input = find_frames({arguments.input});
    const auto folder = std::filesystem::path(arguments.input) / "meshes";
    std::filesystem::create_directories(folder);
    MeshSequenceOptions options;
    options.tolerance = {arguments.tolerance, false};
    options.on_existing = OnExisting::Overwrite;
    options.fit = arguments.fit;
    RunReport report;
    Json row;
    const double program = memory_mb("RssAnon");
    reset_peak();
    row["all"] =
        seconds_of([&] { report = mesh_sequence(input, (folder / "mesh.####.ply").string(), options); });
    const double peak = memory_mb("VmHWM") - memory_mb("RssFile");
    row["above_mb"] = peak - program - 2.0 * grid_mb(input.frames.front().path);
    double particles = 0.0, not_kept = 0.0, read = 0.0, track = 0.0, finish = 0.0;
    for (const FrameReport& frame : report.frames) {
        particles = static_cast<double>(frame.particles);
        not_kept += frame.status == "ok" ? 0.0 : 1.0;
        for (const auto& [stage, seconds] : frame.seconds) {
            if (stage == "total") continue;
            (stage == "read" ? read : stage == "blunt" || stage == "write" ? finish : track) += seconds;
        }
    }
    row["frames"] = report.frames.size();
    row["particles"] = particles;
    row["not_kept"] = not_kept;
    row["reading"] = read;
    row["tracking"] = track;
    row["finishing"] = finish;
    fmt::print("{}", cli::format_table(Json::array({row}), cli::TableFormat::Csv));
    return 0;
}

}  // namespace
}  // namespace isotrack::bench

int main(int argc, char** argv) {
    using namespace isotrack::bench;
    isotrack::keep_little_memory();  // as the program isotrack does
    CLI::App app{"What frames cost as grids and meshes grow"};
    app.require_subcommand(1);
    int result = 0;

    WriteArguments to_write;
    auto* write_command = app.add_subcommand("write", "Write frames and print their voxel size");
    write_command->add_option("folder", to_write.folder)->required();
    auto* size = write_command->add_option_group("size")->require_option(1);
    size->add_option("--voxel", to_write.voxel, "World units")->check(CLI::PositiveNumber);
    size->add_option("--per-diagonal", to_write.per_diagonal, "Voxels per diagonal of the shape")
        ->check(CLI::PositiveNumber);
    write_command->add_option("--frames", to_write.frames)->check(CLI::PositiveNumber)->capture_default_str();
    write_command->add_flag("--perfect", to_write.perfect, "No bumps");
    write_command->callback([&] { result = write(to_write); });

    TrackArguments to_track;
    auto* track_command = app.add_subcommand("track", "Follow frames, print a row of CSV about the last");
    track_command->add_option("input", to_track.input)->required();
    track_command->add_option("--tolerance", to_track.tolerance, "World units")
        ->required()
        ->check(CLI::PositiveNumber);
    track_command->add_option("--measure", to_track.measure, "How many frames are measured: the last ones")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    track_command->add_option("--threads", to_track.threads, "0: one per core")->capture_default_str();
    track_command->add_flag("--fit", to_track.fit, "Vertices leave the surface, as by isotrack mesh --fit");
    track_command->add_flag("--peers", to_track.peers, "OpenVDB's volumeToMesh on the same grids, too");
    track_command->callback([&] { result = track(to_track); });

    FilesArguments of_files;
    auto* files_command = app.add_subcommand("files", "Mesh a folder of frames, print a row of CSV");
    files_command->add_option("folder", of_files.input)->required()->check(CLI::ExistingDirectory);
    files_command->add_option("--tolerance", of_files.tolerance, "World units")
        ->required()
        ->check(CLI::PositiveNumber);
    files_command->add_flag("--fit", of_files.fit, "As for track");
    files_command->callback([&] { result = files(of_files); });

    try {
        openvdb::initialize();
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return result;
}
