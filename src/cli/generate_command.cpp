#include "cli/commands.h"

namespace isotrack::cli {

void add_generate_command(CLI::App&, int&) {}

}  // namespace isotrack::cli
