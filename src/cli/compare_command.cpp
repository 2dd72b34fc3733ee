#include "cli/commands.h"

namespace isotrack::cli {

void add_compare_command(CLI::App&, int&) {}

}  // namespace isotrack::cli
