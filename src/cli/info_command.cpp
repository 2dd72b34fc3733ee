#include "cli/commands.h"

namespace isotrack::cli {

void add_info_command(CLI::App&, int&) {}

}  // namespace isotrack::cli
