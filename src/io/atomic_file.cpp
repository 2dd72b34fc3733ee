#include "io/atomic_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "isotrack/error.h"

namespace isotrack {
namespace {

namespace fs = std::filesystem;

/// Hidden, so that a pattern or a folder does not find it; unique among threads and processes.
fs::path temporary_name(const fs::path& path) {
    static std::atomic<unsigned> counter{0};
    return path.parent_path() /
           fmt::format(".{}.{}-{}.tmp", path.filename().string(), ::getpid(), counter.fetch_add(1));
}

struct RemovedOnExit {
    fs::path path;
    ~RemovedOnExit() {
        std::error_code ignored;
        fs::remove(path, ignored);
    }
};

}  // namespace

void write_atomically(const std::string& path, const std::function<void(std::ostream&)>& fill) {
    const RemovedOnExit temporary{temporary_name(path)};
    errno = 0;
    std::ofstream stream(temporary.path, std::ios::binary);
    if (stream) fill(stream);
    stream.close();
    if (!stream)
        throw IoError(
            fmt::format("cannot write '{}': {}", path, errno != 0 ? std::strerror(errno) : "stream failed"));
    std::error_code error;
    fs::rename(temporary.path, path, error);
    if (error) throw IoError(fmt::format("cannot write '{}': {}", path, error.message()));
}

}  // namespace isotrack
