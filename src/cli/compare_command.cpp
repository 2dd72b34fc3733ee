// isotrack compare: our meshes and OpenVDB's, measured against the same level sets.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/finite.h"
#include "cli/table.h"
#include "io/atomic_file.h"
#include "isotrack/compare/baselines.h"
#include "isotrack/compare/metrics.h"
#include "isotrack/error.h"
#include "isotrack/io/mesh_file.h"
#include "isotrack/io/sequence.h"
#include "isotrack/io/vdb_file.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/tracking/mesh_sequence.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack::cli {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

struct CompareArguments {
    std::vector<std::string> inputs;
    std::string meshes, grid, frames, output;
    std::string tolerance = "0.5vx";
    double iso = 0.0, adaptivity = 0.1;
    bool fit = false, csv = false, json = false;
};

std::unique_ptr<LevelSet> read_level_set(const std::string& path, const CompareArguments& arguments) {
    std::optional<std::string> wanted;
    if (!arguments.grid.empty()) wanted = arguments.grid;
    const GridInfo grid = choose_grid(list_grids(path), wanted, path);
    LevelSetOptions options;
    options.iso = arguments.iso;
    return std::make_unique<LevelSet>(read_grid(path, grid), options);
}

/// Where our mesh of a frame comes from: a file, or a tracker that follows the frames. The seconds are those
/// of making it.
class OurMeshes {
public:
    explicit OurMeshes(const CompareArguments& arguments)
        : pattern_(arguments.meshes), fit_(arguments.fit), tolerance_(parse_length(arguments.tolerance)) {}

    struct Result {
        TriangleMesh mesh;
        std::optional<double> seconds;
    };
    Result mesh_of(int frame, const LevelSet& level_set) {
        if (!pattern_.empty()) return {read_mesh(expand_pattern(pattern_, frame)), std::nullopt};
        if (!tracker_) {
            TrackerOptions options;
            options.tolerance = tolerance_.in_world(level_set.voxel_size());
            options.fit = fit_;
            tracker_.emplace(options);
        }
        const auto start = Clock::now();
        TriangleMesh mesh = tracker_->advance(level_set).mesh;
        return {std::move(mesh), std::chrono::duration<double>(Clock::now() - start).count()};
    }

private:
    std::string pattern_;
    bool fit_;
    Length tolerance_;
    std::optional<Tracker> tracker_;
};

Json make_row(int frame, const std::string& method, const TriangleMesh& mesh, const LevelSet& level_set,
              std::optional<double> seconds) {
    const MeshMetrics m = measure(mesh, level_set);
    const MeshTopology& t = m.topology;
    Json row;
    row["frame"] = frame;
    row["method"] = method;
    row["triangles"] = t.triangles;
    row["vertices"] = t.vertices;
    row["to_max_vx"] = m.to_max;
    row["to_rms_vx"] = m.to_rms;
    row["from_max_vx"] = m.from_max;
    row["from_rms_vx"] = m.from_rms;
    row["min_angle_deg"] = m.min_angle_deg;
    row["angle_p1_deg"] = m.angle_p1_deg;
    row["normal_max_deg"] = m.normal_max_deg;
    row["normal_mean_deg"] = m.normal_mean_deg;
    row["components"] = t.components;
    row["euler"] = t.euler;
    row["genus"] = nullptr;
    if (t.closed() && t.manifold() && t.oriented()) row["genus"] = t.genus();
    row["closed"] = t.closed();
    row["manifold"] = t.manifold();
    row["self_intersections"] = m.self_intersections;
    row["seconds"] = nullptr;
    if (seconds) row["seconds"] = *seconds;
    return row;
}

/// One row per method.
Json compare_frame(const InputFrame& frame, const CompareArguments& arguments, OurMeshes& ours) {
    const std::unique_ptr<LevelSet> level_set = read_level_set(frame.path, arguments);
    auto rows = Json::array();
    const auto our = ours.mesh_of(frame.number, *level_set);
    rows.push_back(make_row(frame.number, "isotrack", our.mesh, *level_set, our.seconds));
    std::vector<double> adaptivities{0.0};
    if (arguments.adaptivity > 0.0) adaptivities.push_back(arguments.adaptivity);
    for (const double adaptivity : adaptivities) {
        const auto start = Clock::now();
        const TriangleMesh mesh = volume_to_mesh(*level_set, adaptivity);
        const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
        rows.push_back(
            make_row(frame.number, fmt::format("volumeToMesh {:g}", adaptivity), mesh, *level_set, seconds));
    }
    return rows;
}

/// One line per method, in the order of the rows.
void summarise(const Json& rows) {
    struct Total {
        std::size_t frames = 0, triangles = 0, sound = 0;
        double error = 0.0, angle = 180.0;
    };
    std::map<std::string, Total> totals;
    std::vector<std::string> order;
    for (const Json& row : rows) {
        const auto [it, fresh] = totals.try_emplace(row["method"].get<std::string>());
        if (fresh) order.push_back(it->first);
        Total& total = it->second;
        ++total.frames;
        total.triangles += row["triangles"].get<std::size_t>();
        total.error =
            std::max({total.error, row["to_max_vx"].get<double>(), row["from_max_vx"].get<double>()});
        if (row["triangles"] != 0) total.angle = std::min(total.angle, row["min_angle_deg"].get<double>());
        total.sound +=
            row["closed"].get<bool>() && row["manifold"].get<bool>() && row["self_intersections"] == 0;
    }
    for (const std::string& method : order) {
        const Total& total = totals[method];
        spdlog::info(
            "{}: {} triangles a frame, largest error {:.3g} voxels, smallest angle {:.3g} degrees, {} of {} "
            "frames "
            "closed, manifold and free of self-intersections",
            method, total.triangles / total.frames, total.error, total.angle, total.sound, total.frames);
    }
}

TableFormat format_of(const CompareArguments& arguments) {
    const std::string extension = std::filesystem::path(arguments.output).extension().string();
    if (arguments.json || (!arguments.csv && extension == ".json")) return TableFormat::Json;
    return arguments.csv || extension == ".csv" ? TableFormat::Csv : TableFormat::Text;
}

/// Told before the work rather than after it.
void check_output(const std::filesystem::path& path) {
    if (std::filesystem::is_directory(path))
        throw OptionError(fmt::format("'{}' is a folder, expected a file for the table", path.string()));
    if (path.has_parent_path() && !std::filesystem::is_directory(path.parent_path()))
        throw OptionError(fmt::format("'{}' is not a folder, the table cannot be written there",
                                      path.parent_path().string()));
}

int run(const CompareArguments& arguments) {
    const InputSequence input = arguments.frames.empty()
                                    ? find_frames(arguments.inputs)
                                    : find_frames(arguments.inputs, parse_frame_range(arguments.frames));
    if (!input.missing.empty())
        spdlog::warn("{} frame numbers have no file, the first is {}", input.missing.size(),
                     input.missing.front());
    if (input.frames.size() > 1 && !arguments.meshes.empty() && !has_frame_field(arguments.meshes))
        throw OptionError(
            fmt::format("'{}' names one mesh for {} frames; put #### where the frame number goes",
                        arguments.meshes, input.frames.size()));
    if (!arguments.output.empty()) check_output(arguments.output);

    OurMeshes ours(arguments);
    auto rows = Json::array();
    std::size_t failed = 0;
    for (const InputFrame& frame : input.frames) try {
            for (Json& row : compare_frame(frame, arguments, ours)) rows.push_back(std::move(row));
            spdlog::debug("frame {} compared", frame.number);
        } catch (const std::exception& error) {
            spdlog::error("frame {}: {}", frame.number, error.what());
            ++failed;
        }

    const std::string table = format_table(rows, format_of(arguments));
    if (arguments.output.empty())
        fmt::print("{}", table);
    else
        write_atomically(arguments.output, [&](std::ostream& file) { file << table; });
    summarise(rows);
    return failed == 0 ? 0 : failed == input.frames.size() ? 1 : 3;
}

}  // namespace

void add_compare_command(CLI::App& app, int& result) {
    auto arguments = std::make_shared<CompareArguments>();
    CLI::App* compare = app.add_subcommand(
        "compare", "Measure our meshes and those of OpenVDB's volumeToMesh against the same level sets");
    compare
        ->add_option("input", arguments->inputs,
                     "VDB files, a folder, or a quoted pattern with ####, %04d or {} for the frame number")
        ->required();
    auto* meshes =
        compare->add_option("--meshes", arguments->meshes,
                            "Our meshes, with #### for the frame number; without it they are made here");
    compare->add_option("--frames", arguments->frames, "A:B or A:B:STEP, ends included");
    compare->add_option("--grid", arguments->grid, "Level-set grid, NAME or NAME[i]");
    compare->add_option("--iso", arguments->iso, "Grid value of the surface")
        ->check(finite())
        ->capture_default_str();
    compare
        ->add_option("--adaptivity", arguments->adaptivity,
                     "volumeToMesh is measured at 0 and at this, 0 to 1")
        ->check(CLI::Range(0.0, 1.0))
        ->option_text("A [0.1]");
    compare
        ->add_option(
            "--tolerance", arguments->tolerance,
            "For meshes made here: largest distance to the level set, in voxels (0.5vx) or world units")
        ->capture_default_str()
        ->excludes(meshes);
    compare->add_flag("--fit", arguments->fit, "For meshes made here: as isotrack mesh --fit")
        ->excludes(meshes);
    auto* csv = compare->add_flag("--csv", arguments->csv, "CSV instead of an aligned table");
    compare->add_flag("--json", arguments->json, "JSON instead of an aligned table")->excludes(csv);
    compare->add_option("-o,--output", arguments->output,
                        "Write the table here instead of stdout; .csv and .json choose the format");
    compare->footer(
        "Columns: to = from the mesh to the level set, from = the way back, both in voxels; angle_p1 = the 1 "
        "% "
        "quantile of the\ntriangles' smallest angles; seconds = of making the mesh, unknown for meshes from "
        "files.");
    compare->callback([arguments, &result] { result = run(*arguments); });
}

}  // namespace isotrack::cli
