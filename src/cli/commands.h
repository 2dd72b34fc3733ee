// The subcommands. Each function adds one to `app`; when it is chosen it runs and leaves its exit code in
// `result`.
#pragma once

#include <CLI/CLI.hpp>

namespace isotrack::cli {

void add_mesh_command(CLI::App& app, int& result);
void add_compare_command(CLI::App& app, int& result);
void add_info_command(CLI::App& app, int& result);
void add_check_command(CLI::App& app, int& result);
void add_generate_command(CLI::App& app, int& result);

}  // namespace isotrack::cli
