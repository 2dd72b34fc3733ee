#include "isotrack/tracking/mesh_sequence.h"

#include <sys/resource.h>

#include <algorithm>
#include <boost/asio/packaged_task.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <future>
#include <memory>

#include "isotrack/error.h"
#include "isotrack/io/mesh_file.h"
#include "isotrack/io/vdb_file.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "tracking/advection.h"

namespace isotrack {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

double peak_memory_mb() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// What the reading thread hands over: a grid, or why there is none. Then the level set made of it.
struct ReadFrame {
    std::string grid_label;
    openvdb::GridBase::ConstPtr grid;
    std::unique_ptr<LevelSet> level_set;
    openvdb::Vec3SGrid::ConstPtr velocity;
    std::string failure;
    double read_seconds = 0.0, open_seconds = 0.0;
};

/// Does `step`, whose failure is that of the frame. Returns the seconds it took.
template <typename Step>
double attempt(ReadFrame& frame, const std::string& path, const Step& step) {
    const auto start = Clock::now();
    try {
        step();
    } catch (const std::exception& error) {
        const std::string what = error.what();
        frame.failure = what.find(path) == std::string::npos ? path + ": " + what : what;
        frame.grid.reset();
    }
    return seconds_since(start);
}

ReadFrame read_frame(const std::string& path, const MeshSequenceOptions& options) {
    ReadFrame frame;
    frame.read_seconds = attempt(frame, path, [&] {
        const std::vector<GridInfo> grids = list_grids(path);
        const GridInfo grid = choose_grid(grids, options.grid, path);
        frame.grid_label = grid.label;
        frame.grid = read_grid(path, grid);
        if (const auto velocity = choose_velocity_grid(grids, options.velocity_grid, path))
            frame.velocity = openvdb::gridPtrCast<openvdb::Vec3SGrid>(read_grid(path, *velocity));
    });
    return frame;
}

/// When the frame's turn has come: a level set takes a good deal more memory than its grid.
void open_level_set(ReadFrame& frame, const std::string& path, const MeshSequenceOptions& options) {
    if (!frame.grid) return;
    frame.open_seconds = attempt(frame, path, [&] {
        LevelSetOptions level_set_options;
        level_set_options.iso = options.iso;
        frame.level_set = std::make_unique<LevelSet>(std::move(frame.grid), level_set_options);
    });
}

TrackerOptions tracker_options(const MeshSequenceOptions& options, double voxel_size) {
    TrackerOptions result;
    result.tolerance = options.tolerance.in_world(voxel_size);
    result.angle_deg = options.angle_deg;
    if (options.min_edge) result.min_edge = options.min_edge->in_world(voxel_size);
    if (options.max_edge) result.max_edge = options.max_edge->in_world(voxel_size);
    result.method = options.method;
    result.reconstruction = options.reconstruction;
    result.delaunay = options.delaunay;
    result.border = options.border;
    result.fit = options.fit;
    result.seed = options.seed;
    return result;
}

/// What can be said before the first frame: lengths in voxels and in world units cannot be compared yet.
void check_options(MeshSequenceOptions options) {
    if (options.fps && !(*options.fps > 0.0)) throw OptionError("the frame rate must be positive");
    if (options.min_edge && options.max_edge && options.min_edge->in_voxels != options.max_edge->in_voxels) {
        MeshSequenceOptions without_smallest = options;
        without_smallest.min_edge.reset();
        check_options(without_smallest);
        options.max_edge.reset();
    }
    const Tracker check(tracker_options(options, 1.0));
}

void check_outputs(const InputSequence& input, const std::string& output,
                   const MeshSequenceOptions& options) {
    if (input.frames.empty()) throw OptionError("no input frames");
    if (!is_mesh_extension(output))
        throw OptionError("cannot tell a mesh format from '" + output +
                          "'; end it in .ply, .obj, .off, .stl or .vtk");
    if (input.frames.size() > 1 && !has_frame_field(output))
        throw OptionError("'" + output + "' names one file for " + std::to_string(input.frames.size()) +
                          " frames; put #### where the frame number goes");
    if (!input.missing.empty() && options.on_missing == OnMissing::Stop)
        throw OptionError(
            "frame " + std::to_string(input.missing.front()) + " is missing" +
            (input.missing.size() > 1 ? " and " + std::to_string(input.missing.size() - 1) + " more" : ""));
    if (options.on_existing == OnExisting::Refuse)
        for (const InputFrame& frame : input.frames) {
            const std::string path = expand_pattern(output, frame.number);
            if (fs::exists(path))
                throw OptionError("'" + path +
                                  "' exists; choose another output, --overwrite or --skip-existing");
        }
    const fs::path folder = fs::path(expand_pattern(output, input.frames.front().number)).parent_path();
    if (folder.empty()) return;
    std::error_code failure;
    fs::create_directories(folder, failure);
    if (failure) throw OptionError("cannot make the folder '" + folder.string() + "': " + failure.message());
}

std::map<std::string, std::string> effective_settings(const MeshSequenceOptions& options,
                                                      const LevelSet& level_set) {
    const double voxel_size = level_set.voxel_size();
    const TrackerOptions tracker = tracker_options(options, voxel_size);
    const SizingLimits limits = sizing_limits(tracker, level_set);
    std::map<std::string, std::string> s;
    const auto length = [&](double world) {
        char text[96];
        std::snprintf(text, sizeof text, "%.6g (%.4gvx)", world, world / voxel_size);
        return std::string(text);
    };
    s["tolerance"] = length(effective_tolerance(tracker, level_set));
    s["min_edge"] = length(limits.min_edge);
    s["max_edge"] = length(limits.max_edge);
    s["angle"] = std::to_string(std::lround(options.angle_deg.value_or(default_angle_deg(options.method)))) +
                 " degrees";
    s["method"] = options.method == Method::Paper ? "paper" : "tolerance";
    s["border"] = options.border == Border::Open ? "open" : "close";
    s["delaunay"] = name_of(options.delaunay);
    s["reconstruct"] = options.reconstruction == Reconstruction::Pure ? "pure" : "guided";
    s["fit"] = options.fit ? "on" : "off";
    s["seed"] = std::to_string(options.seed);
    s["voxel_size"] = length(voxel_size);
    if (options.iso != 0.0) s["iso"] = std::to_string(options.iso);
    if (options.fps) s["fps"] = std::to_string(*options.fps);
    return s;
}

void describe(const LevelSet& level_set, FrameReport& row) {
    row.voxel_size = level_set.voxel_size();
    row.active_voxels = level_set.active_voxels();
    row.surface_euler = level_set.lattice_euler();
}

/// Of a surface that is described.
void describe(const TrackedFrame& tracked, FrameReport& row) {
    const double voxel = row.voxel_size;
    const MeshTopology topology = mesh_topology(tracked.mesh);
    row.particles = tracked.particles;
    row.vertices = tracked.mesh.points.size();
    row.triangles = tracked.mesh.triangles.size();
    row.components = topology.components;
    row.euler = topology.euler;
    row.closed = topology.closed() && topology.oriented();
    row.manifold = topology.manifold();
    row.opened = tracked.opened;
    row.lost_crossings = tracked.lost_crossings;
    row.self_intersections = self_intersections(tracked.mesh).size();
    row.born = tracked.born;
    row.died = tracked.died;
    row.seeded = tracked.seeded;
    row.lost = tracked.lost;
    row.sweeps = tracked.sweeps;
    row.relocated = tracked.relocated;
    row.delaunay_strategy = tracked.delaunay_strategy;
    row.max_error_vx = tracked.max_error / voxel;
    row.rms_error_vx = tracked.rms_error / voxel;
    row.most_turned_deg = tracked.most_turned_deg;
    const std::vector<double> angles = smallest_angles(tracked.mesh);
    row.min_angle_deg = angles.empty() ? 0.0 : *std::min_element(angles.begin(), angles.end());
    row.seconds = tracked.seconds;
    if (tracked.mesh.empty()) {
        row.status = "empty";
    } else if (!tracked.within_tolerance) {
        char text[128];
        std::snprintf(text, sizeof text, "largest error %.4g voxels, tolerance %.4g",
                      tracked.max_error / voxel, tracked.tolerance / voxel);
        row.status = "tolerance_not_met";
        row.message = text;
        if (tracked.lost_crossings > 0)
            row.message += "; " + std::to_string(tracked.lost_crossings) +
                           " grid edges cross surface that the mesh lost";
        if (tracked.most_turned_deg >= kTurnedOverDeg) row.message += "; a triangle is turned over";
    }
    if (row.has_other_topology())
        row.message += (row.message.empty() ? "" : "; ") + ("Euler number " + std::to_string(row.euler)) +
                       ", the level set's " + std::to_string(*row.surface_euler);
}

}  // namespace

Length parse_length(const std::string& text) {
    Length length;
    std::string number = text;
    if (number.size() > 2 && number.compare(number.size() - 2, 2, "vx") == 0) {
        length.in_voxels = true;
        number.resize(number.size() - 2);
    }
    std::size_t used = 0;
    try {
        length.value = std::stod(number, &used);
    } catch (const std::exception&) {
        used = 0;
    }
    if (used == 0 || used != number.size() || !(length.value > 0.0) || !std::isfinite(length.value))
        throw OptionError("expected a positive length such as 0.5vx (voxels) or 0.01 (world units), got '" +
                          text + "'");
    return length;
}

std::string to_string(const Length& length) {
    char text[64];
    std::snprintf(text, sizeof text, "%g%s", length.value, length.in_voxels ? "vx" : "");
    return text;
}

RunReport mesh_sequence(const InputSequence& input, const std::string& output,
                        const MeshSequenceOptions& options, const MeshSequenceEvents& events) {
    check_options(options);
    check_outputs(input, output, options);
    RunReport report;
    report.version = ISOTRACK_VERSION;
    std::optional<Tracker> tracker;
    openvdb::Vec3SGrid::ConstPtr velocity;  // of the frame the particles are on
    int tracked_frame = 0;

    const auto skipped = [&](const InputFrame& frame) {
        return options.on_existing == OnExisting::Skip && fs::exists(expand_pattern(output, frame.number));
    };

    // Writes a frame and then reads the next but one, while that between them is tracked: two grids at once,
    // not three. One thread, because the allocator may keep for each what it has freed.
    boost::asio::thread_pool beside(1);
    const auto start_reading = [&](std::size_t i) {
        if (i >= input.frames.size() || skipped(input.frames[i])) return std::future<ReadFrame>();
        return boost::asio::post(beside, std::packaged_task<ReadFrame()>(
                                             [&, i] { return read_frame(input.frames[i].path, options); }));
    };

    /// The last frame, whose mesh is being finished and written.
    struct Pending {
        FrameReport row;
        std::future<FrameReport> written;
    };
    std::optional<Pending> pending;
    bool stop = false;
    const auto finish = [&](FrameReport row) {
        row.peak_memory_mb = peak_memory_mb();
        report.frames.push_back(row);
        if (events.finished) events.finished(report.frames.back());
    };
    const auto finish_pending = [&] {
        if (!pending) return;
        FrameReport row = std::move(pending->row);
        auto written = std::move(pending->written);
        pending.reset();
        try {
            row = written.get();
        } catch (const std::exception& error) {
            row.status = "failed";
            row.message = error.what();
            stop = true;  // a full disk does not get better with the next frame
        }
        finish(std::move(row));
    };

    std::future<ReadFrame> next = start_reading(0);
    for (std::size_t i = 0; i < input.frames.size() && !stop; ++i) {
        const auto start = Clock::now();
        FrameReport row;
        row.frame = input.frames[i].number;
        row.time = options.fps ? (row.frame - input.frames.front().number) / *options.fps : row.frame;
        row.input = input.frames[i].path;
        row.output = expand_pattern(output, row.frame);
        if (!next.valid()) {
            finish_pending();
            row.status = "skipped";
            row.message = "output exists";
            finish(std::move(row));
            next = start_reading(i + 1);
            continue;
        }
        ReadFrame read = next.get();
        next = start_reading(i + 1);
        open_level_set(read, row.input, options);
        row.grid = read.grid_label;
        if (!read.level_set) {
            finish_pending();
            row.seconds = {{"read", read.read_seconds}, {"open", read.open_seconds}};
            row.status = "failed";
            row.message = read.failure;
            stop = stop || options.on_error == OnError::Stop;
            finish(std::move(row));
            continue;
        }
        if (!tracker && !read.level_set->empty()) {
            const TrackerOptions resolved = tracker_options(options, read.level_set->voxel_size());
            tracker.emplace(resolved);
            report.settings = effective_settings(options, *read.level_set);
            if (events.started) events.started(report);
        }
        Tracker::Motion motion;
        const int frames_passed = row.frame - tracked_frame;
        if (velocity && frames_passed > 0)
            motion = motion_along(velocity, read.velocity, frames_passed / options.fps.value_or(1.0));
        Tracker::Finish finish_mesh = [] { return TrackedFrame(); };
        try {
            if (tracker) finish_mesh = tracker->begin(*read.level_set, motion);
        } catch (const std::exception& error) {
            finish_pending();
            row.status = "failed";
            row.message = row.input + ": " + error.what();
            stop = stop || options.on_error == OnError::Stop;
            finish(std::move(row));
            continue;
        }
        const double per_time = options.fps.value_or(1.0) / std::max(1, frames_passed);
        velocity = read.velocity;
        tracked_frame = row.frame;
        finish_pending();
        if (stop) break;
        auto write = [row, start, per_time, finish_mesh = std::move(finish_mesh),
                      read_seconds = read.read_seconds, open_seconds = read.open_seconds,
                      level_set = std::move(read.level_set)]() mutable {
            TrackedFrame tracked = finish_mesh();
            finish_mesh = nullptr;  // the future would keep what it has
            describe(*level_set, row);
            level_set.reset();
            for (Vec3& v : tracked.mesh.velocities) v *= per_time;
            describe(tracked, row);
            row.seconds["read"] = read_seconds;
            row.seconds["open"] = open_seconds;
            row.seconds["total"] = seconds_since(start);
            const auto write_start = Clock::now();
            write_mesh(tracked.mesh, row.output);
            row.seconds["write"] = seconds_since(write_start);
            return row;
        };
        pending.emplace(Pending{
            std::move(row), boost::asio::post(beside, std::packaged_task<FrameReport()>(std::move(write)))});
    }
    finish_pending();
    return report;
}

int exit_code(const RunReport& report) {
    std::size_t good = 0, failed = 0;
    for (const FrameReport& row : report.frames) {
        if (row.status == "failed") ++failed;
        if ((row.status == "ok" && (row.closed || row.opened) && row.manifold &&
             row.self_intersections == 0) ||
            row.status == "empty" || row.status == "skipped")
            ++good;
    }
    if (good == report.frames.size()) return 0;
    return failed == report.frames.size() ? 1 : 3;
}

}  // namespace isotrack
