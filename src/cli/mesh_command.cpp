// isotrack mesh: the main job.
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>

#include "cli/commands.h"
#include "cli/finite.h"
#include "isotrack/tracking/mesh_sequence.h"

namespace isotrack::cli {
namespace {

struct MeshArguments {
    std::vector<std::string> inputs;
    std::string output, report;
    std::string tolerance = "0.5vx", min_edge, max_edge;
    std::string frames, grid, velocity_grid;
    double fps = 0.0, angle = 0.0;
    bool overwrite = false, skip_existing = false;
    MeshSequenceOptions options;
};

/// A bar with the time left on a terminal, a line per frame elsewhere.
class Progress {
public:
    explicit Progress(std::size_t frames) : frames_(frames), start_(std::chrono::steady_clock::now()) {}

    void show(const FrameReport& row) {
        ++done_;
        const bool bad =
            row.status == "failed" || row.status == "tolerance_not_met" || row.has_other_topology();
        if (terminal_ && bad) fmt::print(stderr, "\r\033[K");
        if (row.status == "failed")
            spdlog::error("{}",
                          frames_ > 1 ? fmt::format("frame {}: {}", row.frame, row.message) : row.message);
        else if (bad)
            spdlog::warn("frame {}: {}", row.frame, row.message);
        if (spdlog::get_level() > spdlog::level::info) return;
        if (terminal_)
            bar();
        else if (!bad)
            spdlog::log(spdlog::level::debug, "frame {}: {} triangles, error {:.3f} vx, {:.2f} s{}",
                        row.frame, row.triangles, row.max_error_vx,
                        row.seconds.count("total") ? row.seconds.at("total") : 0.0,
                        row.status == "ok" ? "" : ", " + row.status);
    }
    void clear() const {
        if (terminal_) fmt::print(stderr, "\r\033[K");
    }
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

private:
    void bar() const {
        constexpr std::size_t kWidth = 30;
        const std::size_t filled = kWidth * done_ / std::max<std::size_t>(1, frames_);
        const double left = seconds() / static_cast<double>(done_) * static_cast<double>(frames_ - done_);
        fmt::print(stderr, "\r\033[K[{}{}] {}/{} frames, {:.0f} s left", std::string(filled, '#'),
                   std::string(kWidth - filled, '.'), done_, frames_, left);
    }
    std::size_t frames_, done_ = 0;
    std::chrono::steady_clock::time_point start_;
    bool terminal_ = isatty(STDERR_FILENO) != 0;
};

void summarise(const RunReport& report, const std::string& output, double seconds) {
    std::size_t written = 0, failed = 0, missed = 0, unsound = 0, unlike = 0, least = 0, most = 0;
    double error = 0.0;
    for (const FrameReport& row : report.frames) {
        failed += row.status == "failed";
        missed += row.status == "tolerance_not_met";
        if (row.status == "failed" || row.status == "skipped") continue;
        unsound += !row.closed || !row.manifold || row.self_intersections > 0;
        unlike += row.has_other_topology();
        least = written == 0 ? row.triangles : std::min(least, row.triangles);
        most = std::max(most, row.triangles);
        error = std::max(error, row.max_error_vx);
        ++written;
    }
    if (written > 0)
        spdlog::info("{} written to {}: {} triangles, largest error {:.3f} voxels, {}; {:.1f} s",
                     written == 1 ? "1 mesh" : fmt::format("{} meshes", written), output,
                     least == most ? std::to_string(most) : fmt::format("{} to {}", least, most), error,
                     unsound == 0 ? "all closed, manifold and free of self-intersections"
                                  : fmt::format("{} not sound", unsound),
                     seconds);
    if (missed > 0) spdlog::warn("{} frames missed the tolerance", missed);
    if (unlike > 0) spdlog::warn("{} frames have another topology than their level sets", unlike);
    if (failed > 0 && report.frames.size() > 1)
        spdlog::error("{} of {} frames failed", failed, report.frames.size());
}

int run(MeshArguments& a, const CLI::App& app, const std::string& command_line) {
    MeshSequenceOptions& o = a.options;
    o.tolerance = parse_length(a.tolerance);
    if (!a.min_edge.empty()) o.min_edge = parse_length(a.min_edge);
    if (!a.max_edge.empty()) o.max_edge = parse_length(a.max_edge);
    if (app.count("--grid")) o.grid = a.grid;
    if (app.count("--velocity-grid")) o.velocity_grid = a.velocity_grid;
    if (app.count("--angle")) o.angle_deg = a.angle;
    if (app.count("--fps")) o.fps = a.fps;
    o.on_existing = a.overwrite       ? OnExisting::Overwrite
                    : a.skip_existing ? OnExisting::Skip
                                      : OnExisting::Refuse;

    const InputSequence input =
        a.frames.empty() ? find_frames(a.inputs) : find_frames(a.inputs, parse_frame_range(a.frames));
    if (!input.missing.empty() && o.on_missing == OnMissing::Skip)
        spdlog::warn("{} frame numbers have no file, the first is {}", input.missing.size(),
                     input.missing.front());

    Progress progress(input.frames.size());
    MeshSequenceEvents events;
    events.started = [](const RunReport& report) {
        std::string line;
        for (const auto& [name, value] : report.settings)
            line += (line.empty() ? "" : ", ") + name + " " + value;
        spdlog::info("{}", line);
    };
    events.finished = [&](const FrameReport& row) { progress.show(row); };
    RunReport report = mesh_sequence(input, a.output, o, events);
    progress.clear();
    report.command_line = command_line;
    if (!a.report.empty()) write_run_report(report, a.report);
    summarise(report, a.output, progress.seconds());
    return exit_code(report);
}

}  // namespace

void add_mesh_command(CLI::App& app, int& result) {
    auto a = std::make_shared<MeshArguments>();
    CLI::App* mesh = app.add_subcommand(
        "mesh", "Track level-set frames and write one adaptive, watertight mesh per frame");
    mesh->add_option("input", a->inputs,
                     "VDB files, a folder, or a quoted pattern with ####, %04d or {} for the frame number")
        ->required();
    mesh->add_option("-o,--output", a->output,
                     "Mesh files, with #### for the frame number: .ply .obj .off .stl .vtk")
        ->required();
    mesh->add_option("--tolerance", a->tolerance,
                     "Largest distance between mesh and level set, either way: 0.5vx (voxels) or world units")
        ->capture_default_str();
    mesh->add_option("--angle", a->angle,
                     "Wanted angle between neighbour normals, degrees (default 60, with --method paper 20)");
    mesh->add_option("--min-edge", a->min_edge,
                     "Smallest particle spacing (default 0.5vx, or the tolerance)");
    mesh->add_option("--max-edge", a->max_edge, "Largest particle spacing (default 80 of the smallest)");
    mesh->add_option("--frames", a->frames, "A:B or A:B:STEP, ends included");
    mesh->add_option("--grid", a->grid, "Level-set grid, NAME or NAME[i]");
    mesh->add_option("--velocity-grid", a->velocity_grid, "Velocity grid, NAME or NAME[i]");
    mesh->add_option("--iso", a->options.iso, "Grid value of the surface")
        ->check(finite())
        ->capture_default_str();
    mesh->add_option("--fps", a->fps, "Frames per second: velocities are then per second, else per frame");
    const std::map<std::string, Method> methods{{"tolerance", Method::Tolerance}, {"paper", Method::Paper}};
    mesh->add_option("--method", a->options.method, "How particles are spaced: tolerance or paper")
        ->transform(CLI::CheckedTransformer(methods).description(""))
        ->option_text("tolerance|paper [tolerance]");
    const std::map<std::string, Reconstruction> reconstructions{{"guided", Reconstruction::Guided},
                                                                {"pure", Reconstruction::Pure}};
    mesh->add_option("--reconstruct", a->options.reconstruction,
                     "Convection guided by the level set, or of the particles alone")
        ->transform(CLI::CheckedTransformer(reconstructions).description(""))
        ->option_text("guided|pure [guided]");
    const std::map<std::string, UpdateStrategy> strategies{{"auto", UpdateStrategy::Auto},
                                                           {"rebuild", UpdateStrategy::Rebuild},
                                                           {"lazy", UpdateStrategy::Lazy},
                                                           {"move", UpdateStrategy::Move}};
    mesh->add_option("--delaunay", a->options.delaunay,
                     "How the DT follows the particles: what is cheaper, built anew, the paper's two ways")
        ->transform(CLI::CheckedTransformer(strategies).description(""))
        ->option_text("auto|rebuild|lazy|move [auto]");
    const std::map<std::string, Border> borders{{"close", Border::Close}, {"open", Border::Open}};
    mesh->add_option(
            "--border", a->options.border,
            "Where the surface runs into the border of its grid: close it by a flat cap, or leave it open")
        ->transform(CLI::CheckedTransformer(borders).description(""))
        ->option_text("close|open [close]");
    const std::map<std::string, OnError> on_error{{"skip", OnError::Skip}, {"stop", OnError::Stop}};
    mesh->add_option("--on-error", a->options.on_error, "After a frame that cannot be used: skip it or stop")
        ->transform(CLI::CheckedTransformer(on_error).description(""))
        ->option_text("skip|stop [skip]");
    const std::map<std::string, OnMissing> on_missing{{"skip", OnMissing::Skip}, {"stop", OnMissing::Stop}};
    mesh->add_option("--on-missing", a->options.on_missing,
                     "A gap in the frame numbers: go on or refuse to start")
        ->transform(CLI::CheckedTransformer(on_missing).description(""))
        ->option_text("skip|stop [skip]");
    mesh->add_flag("--fit", a->options.fit,
                   "Move vertices off the surface so that the triangles are nearer to it: fewer triangles");
    mesh->add_option("--seed", a->options.seed, "Same seed, same meshes")->capture_default_str();
    mesh->add_option("--report", a->report, "Write run.json here: settings and one row per frame");
    auto* overwrite = mesh->add_flag("--overwrite", a->overwrite, "Replace meshes that exist");
    mesh->add_flag("--skip-existing", a->skip_existing, "Leave out frames whose mesh exists")
        ->excludes(overwrite);
    mesh->callback([a, mesh, &result] {
        std::string line = "isotrack mesh";
        for (const auto* option : mesh->get_options())
            if (option->count() > 0) {
                if (!option->get_positional()) line += " " + option->get_name();
                for (const auto& value : option->results())
                    if (option->get_expected_max() > 0) line += " '" + value + "'";
            }
        result = run(*a, *mesh, line);
    });
}

}  // namespace isotrack::cli
