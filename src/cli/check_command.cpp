#include "cli/commands.h"

namespace isotrack::cli {

void add_check_command(CLI::App&, int&) {}

}  // namespace isotrack::cli
