// isotrack info: what is in the frames, and what would be tracked.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/finite.h"
#include "isotrack/error.h"
#include "isotrack/io/sequence.h"
#include "isotrack/io/vdb_file.h"
#include "isotrack/surface/level_set.h"

namespace isotrack::cli {
namespace {

using Json = nlohmann::ordered_json;

struct InfoArguments {
    std::vector<std::string> inputs;
    std::string frames, grid;
    double iso = 0.0;
    bool json = false;
};

/// What would be tracked in one frame.
struct Tracked {
    GridInfo grid;
    double voxel_size, value_scale;
    std::size_t active_voxels, crossings, border_crossings;
    Box bounds;  ///< Empty without a surface.
};

struct FrameInfo {
    InputFrame frame;
    std::vector<GridInfo> grids;     ///< Empty where the file cannot be read.
    std::optional<Tracked> tracked;  ///< Unset where nothing can be tracked; `error` says why.
    std::string error;
};

FrameInfo examine(const InputFrame& frame, const InfoArguments& arguments) {
    FrameInfo info{frame, {}, {}, {}};
    try {
        info.grids = list_grids(frame.path);
        const std::optional<std::string> wanted =
            arguments.grid.empty() ? std::nullopt : std::optional(arguments.grid);
        const GridInfo grid = choose_grid(info.grids, wanted, frame.path);
        const LevelSet level_set(read_grid(frame.path, grid), {arguments.iso});
        info.tracked = Tracked{grid,
                               level_set.voxel_size(),
                               level_set.value_scale(),
                               level_set.active_voxels(),
                               level_set.crossing_count(),
                               level_set.border_crossings(),
                               level_set.bounds()};
    } catch (const Error& error) {
        info.error = error.what();
        if (info.error.find(frame.path) == std::string::npos)
            info.error = fmt::format("'{}': {}", frame.path, info.error);
    }
    return info;
}

/// "3-5, 8"
std::string shorten(const std::vector<int>& numbers) {
    std::string text;
    for (std::size_t begin = 0, end; begin < numbers.size(); begin = end) {
        end = begin + 1;
        while (end < numbers.size() && numbers[end] == numbers[end - 1] + 1) ++end;
        text += fmt::format("{}{}", text.empty() ? "" : ", ", numbers[begin]);
        if (end - begin > 1) text += fmt::format("-{}", numbers[end - 1]);
    }
    return text;
}

std::string show(const Box& box) {
    if (box.isEmpty()) return "no surface";
    const Vec3 &a = box.min(), &b = box.max();
    return fmt::format("{:.5g} {:.5g} {:.5g} to {:.5g} {:.5g} {:.5g}", a.x(), a.y(), a.z(), b.x(), b.y(),
                       b.z());
}

/// The grids of one frame; a star marks the one that would be tracked.
void print_grids(const FrameInfo& info) {
    std::size_t width = 4;
    for (const GridInfo& grid : info.grids) width = std::max(width, grid.label.size());
    fmt::print("grids of {}\n", info.frame.path);
    fmt::print("  {:<{}}  {:<7} {:<10}  {:>10}  {:>12}  {:<4}  {}\n", "name", width, "type", "class", "voxel",
               "active", "half", "transform");
    for (const GridInfo& grid : info.grids)
        fmt::print("{} {:<{}}  {:<7} {:<10}  {:>10}  {:>12}  {:<4}  {}\n",
                   info.tracked && info.tracked->grid.label == grid.label ? '*' : ' ', grid.label, width,
                   grid.type, grid.grid_class,
                   grid.voxel_size > 0.0 ? fmt::format("{:.6g}", grid.voxel_size) : "?",
                   grid.active_voxels ? std::to_string(*grid.active_voxels) : "?", grid.half ? "yes" : "no",
                   grid.transform.empty() ? "?" : grid.transform);
}

void print_row_header() {
    fmt::print("\n{:>7}  {:<12}  {:>10}  {:>12}  {:>10}  {:>10}  {:>8}  {}\n", "frame", "grid", "voxel",
               "active", "scale", "crossings", "border", "bounds");
}

void print_row(const FrameInfo& info) {
    const Tracked& t = *info.tracked;
    fmt::print("{:>7}  {:<12}  {:>10.6g}  {:>12}  {:>10.6g}  {:>10}  {:>8}  {}\n", info.frame.number,
               t.grid.label, t.voxel_size, t.active_voxels, t.value_scale, t.crossings, t.border_crossings,
               show(t.bounds));
}

Json to_json(const Box& box) {
    if (box.isEmpty()) return nullptr;
    const Vec3 &a = box.min(), &b = box.max();
    return {{"min", {a.x(), a.y(), a.z()}}, {"max", {b.x(), b.y(), b.z()}}};
}

Json to_json(const GridInfo& grid) {
    return {{"label", grid.label},
            {"name", grid.name},
            {"type", grid.type},
            {"class", grid.grid_class},
            {"half", grid.half},
            {"voxel_size", grid.voxel_size > 0.0 ? Json(grid.voxel_size) : Json(nullptr)},
            {"active_voxels", grid.active_voxels ? Json(*grid.active_voxels) : Json(nullptr)},
            {"transform", grid.transform.empty() ? Json(nullptr) : Json(grid.transform)}};
}

Json to_json(const Tracked& tracked) {
    return {{"grid", tracked.grid.label},
            {"voxel_size", tracked.voxel_size},
            {"value_scale", tracked.value_scale},
            {"active_voxels", tracked.active_voxels},
            {"bounds", to_json(tracked.bounds)},
            {"crossings", tracked.crossings},
            {"border_crossings", tracked.border_crossings}};
}

Json to_json(const FrameInfo& info) {
    Json grids = Json::array();
    for (const GridInfo& grid : info.grids) grids.push_back(to_json(grid));
    return {{"frame", info.frame.number},
            {"input", info.frame.path},
            {"grids", grids},
            {"tracked", info.tracked ? to_json(*info.tracked) : Json(nullptr)},
            {"error", info.error.empty() ? Json(nullptr) : Json(info.error)}};
}

int run(const InfoArguments& arguments) {
    const InputSequence input = arguments.frames.empty()
                                    ? find_frames(arguments.inputs)
                                    : find_frames(arguments.inputs, parse_frame_range(arguments.frames));
    Json frames = Json::array();
    bool grids_shown = false, row_shown = false;
    std::size_t bad = 0;
    for (const InputFrame& frame : input.frames) {
        const FrameInfo info = examine(frame, arguments);
        if (arguments.json) {
            frames.push_back(to_json(info));
        } else {
            if (!grids_shown && !info.grids.empty()) print_grids(info);
            grids_shown = grids_shown || !info.grids.empty();
            if (info.tracked) {
                if (!row_shown) print_row_header();
                row_shown = true;
                print_row(info);
            }
            std::fflush(stdout);  // keeps its place among the errors
        }
        if (!info.tracked) {
            ++bad;
            spdlog::error("frame {}: {}", frame.number, info.error);
        }
    }
    if (arguments.json)
        fmt::print("{}\n", Json{{"frames", frames}, {"missing", input.missing}}.dump(
                               1, ' ', false, Json::error_handler_t::replace));
    if (!input.missing.empty()) spdlog::warn("no file for frame {}", shorten(input.missing));
    return bad == 0 ? 0 : bad == input.frames.size() ? 1 : 3;
}

}  // namespace

void add_info_command(CLI::App& app, int& result) {
    auto arguments = std::make_shared<InfoArguments>();
    CLI::App* info =
        app.add_subcommand("info",
                           "Show the grids of VDB frames and what would be tracked (crossings: edges between "
                           "voxels that the surface crosses; border: those that leave the active voxels)");
    info->add_option("input", arguments->inputs,
                     "VDB files, a folder, or a quoted pattern with ####, %04d or {} for the frame number")
        ->required();
    info->add_option("--frames", arguments->frames, "A:B or A:B:STEP, ends included");
    info->add_option("--grid", arguments->grid, "Level-set grid, NAME or NAME[i]");
    info->add_option("--iso", arguments->iso, "Grid value of the surface")
        ->check(finite())
        ->capture_default_str();
    info->add_flag("--json", arguments->json, "One JSON object instead of tables");
    info->callback([arguments, &result] { result = run(*arguments); });
}

}  // namespace isotrack::cli
