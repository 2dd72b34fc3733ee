// The program `isotrack`: finds the subcommand, runs it, turns what was thrown into one line and an exit
// code.
#include <openvdb/openvdb.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <tbb/global_control.h>

#include <exception>
#include <new>
#include <optional>
#include <thread>

#include "cli/commands.h"
#include "isotrack/error.h"
#include "isotrack/memory.h"

int main(int argc, char** argv) {
    using namespace isotrack;
    int result = 0;
    bool quiet = false;
    int verbosity = 0, threads = 0;
    keep_little_memory();

    CLI::App app{"isotrack " ISOTRACK_VERSION ": OpenVDB level-set sequences to adaptive watertight meshes"};
    app.set_version_flag("--version", "isotrack " ISOTRACK_VERSION);
    app.require_subcommand(1);
    app.fallthrough();
    app.failure_message(CLI::FailureMessage::simple);
    app.add_flag("-q,--quiet", quiet, "Only errors on stderr");
    app.add_flag("-v,--verbose", verbosity, "More on stderr");
    app.add_option("--threads", threads, "Threads to use; 0: one per core")
        ->check(CLI::Range(0, 1024))
        ->capture_default_str();

    spdlog::set_default_logger(spdlog::stderr_color_mt("isotrack"));
    spdlog::set_pattern("%^%l%$: %v");
    std::optional<tbb::global_control> thread_limit;
    app.parse_complete_callback([&] {
        spdlog::set_level(quiet           ? spdlog::level::err
                          : verbosity > 0 ? spdlog::level::debug
                                          : spdlog::level::info);
        const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
        thread_limit.emplace(tbb::global_control::max_allowed_parallelism, threads > 0 ? threads : cores);
    });

    cli::add_mesh_command(app, result);
    cli::add_compare_command(app, result);
    cli::add_info_command(app, result);
    cli::add_check_command(app, result);
    cli::add_generate_command(app, result);

    try {
        openvdb::initialize();
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const OptionError& error) {
        spdlog::error("{}", error.what());
        return 2;
    } catch (const std::bad_alloc&) {
        spdlog::error("out of memory");
        return 1;
    } catch (const std::exception& error) {
        spdlog::error("{}", error.what());
        return 1;
    }
    return result;
}
