// isotrack generate: sample sequences, written as VDB files.
#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>
#include <spdlog/spdlog.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "cli/commands.h"
#include "isotrack/error.h"
#include "isotrack/io/sample_sequence.h"
#include "isotrack/io/sequence.h"

namespace isotrack::cli {
namespace {

namespace fs = std::filesystem;

struct GenerateArguments {
    std::string shape, output;
    SampleSequenceOptions options;
    int first_frame = 1;
    bool overwrite = false;
};

std::string list_of_shapes() {
    std::string text = "Shapes:\n";
    for (const SampleShape& shape : sample_shapes())
        text += fmt::format("  {:<12}{} [voxel {}]\n", shape.name, shape.description, shape.default_voxel);
    return text;
}

/// One path per frame, none of which may exist unless it may be overwritten.
std::vector<fs::path> output_paths(const GenerateArguments& arguments) {
    const int frames = arguments.options.frames;
    if (frames > 1 && !has_frame_field(arguments.output))
        throw OptionError(
            fmt::format("'{}' names one file for {} frames, expected a number field such as ####",
                        arguments.output, frames));
    if (fs::path(arguments.output).extension() != ".vdb")
        throw OptionError(fmt::format("expected an output that ends in .vdb, got '{}'", arguments.output));
    std::vector<fs::path> paths;
    for (int i = 0; i < frames; ++i) {
        paths.emplace_back(expand_pattern(arguments.output, arguments.first_frame + i));
        if (!arguments.overwrite && fs::exists(fs::symlink_status(paths.back())))
            throw OptionError(
                fmt::format("'{}' exists already; --overwrite replaces it", paths.back().string()));
    }
    return paths;
}

/// Writes a file as openvdb::io::File does, but notices when not all of it arrives: on a full disk File says
/// nothing.
class CheckedFile : public openvdb::io::Archive {
public:
    void write(const openvdb::GridCPtrVec& grids, const fs::path& path) const {
        std::ofstream stream(path, std::ios::binary);
        if (stream) Archive::write(stream, grids, /*seekable=*/true);
        stream.close();
        if (!stream) throw IoError(std::generic_category().message(errno));
    }
};

/// By a temporary name in the same folder, so that no reader ever meets half a file.
void write_frame(const SampleFrame& frame, const fs::path& path) {
    openvdb::GridCPtrVec grids;
    grids.push_back(frame.surface);
    if (frame.velocity) grids.push_back(frame.velocity);
    fs::path temporary = path;
    temporary += ".part";
    try {
        CheckedFile().write(grids, temporary);
        fs::rename(temporary, path);
    } catch (const std::exception& error) {
        std::error_code ignored;
        fs::remove(temporary, ignored);
        throw IoError(fmt::format("cannot write '{}': {}", path.string(), error.what()));
    }
}

void make_folder_of(const fs::path& path) {
    if (!path.has_parent_path()) return;
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    if (error)
        throw IoError(
            fmt::format("cannot make the folder '{}': {}", path.parent_path().string(), error.message()));
}

int generate(const GenerateArguments& arguments) {
    SampleSequence sequence(arguments.shape, arguments.options);
    const std::vector<fs::path> paths = output_paths(arguments);
    for (const fs::path& path : paths) make_folder_of(path);
    for (const fs::path& path : paths) {
        const SampleFrame frame = sequence.next();
        write_frame(frame, path);
        spdlog::debug("{}: {} voxels", path.string(), frame.surface->activeVoxelCount());
    }
    spdlog::info("wrote {} frame{} of {}, {} to {}", paths.size(), paths.size() == 1 ? "" : "s",
                 arguments.shape, paths.front().string(), paths.back().string());
    return 0;
}

}  // namespace

void add_generate_command(CLI::App& app, int& result) {
    CLI::App* command = app.add_subcommand("generate", "Make a sample sequence of level sets");
    const auto arguments = std::make_shared<GenerateArguments>();
    SampleSequenceOptions& options = arguments->options;
    command->add_option("SHAPE", arguments->shape, "One of the shapes below")->required();
    command->add_option("-o,--output", arguments->output, "Files to write, with #### for the frame number")
        ->required();
    command->add_option("--frames", options.frames, "Number of frames; the motion is spread over them")
        ->check(CLI::Range(1, 1000000))
        ->capture_default_str();
    command->add_option("--voxel", options.voxel,
                        "Voxel size in world units, 0.0001 to 0.1; the shapes fill a unit cube");
    command->add_option("--seed", options.seed, "Seed of the splash")->capture_default_str();
    command->add_option("--first-frame", arguments->first_frame, "Number of the first file")
        ->check(CLI::Range(0, 100000000))
        ->capture_default_str();
    command->add_flag("--overwrite", arguments->overwrite,
                      "Replace files that exist; without it nothing is done");
    command->footer(list_of_shapes());
    command->callback([arguments, &result] { result = generate(*arguments); });
}

}  // namespace isotrack::cli
