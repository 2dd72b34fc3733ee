// Files that are whole or not there.
#pragma once

#include <functional>
#include <iosfwd>
#include <string>

namespace isotrack {

/// Lets `fill` write to a temporary name in the folder of `path` and then renames: whoever looks at `path`
/// sees the old file or the new one, never a part. What `fill` throws goes through, the temporary file is
/// removed. \throws IoError naming `path` and the cause.
void write_atomically(const std::string& path, const std::function<void(std::ostream&)>& fill);

}  // namespace isotrack
