#include "cli/commands.h"

namespace isotrack::cli {

void add_mesh_command(CLI::App&, int&) {}

}  // namespace isotrack::cli
