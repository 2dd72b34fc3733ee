// What the system says of this process's memory.
#pragma once

#include <fstream>
#include <string>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace isotrack::support {

/// A line of /proc/self/status, MB; 0 where there is none.
inline double memory_mb(const std::string& name) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind(name + ":", 0) == 0) return std::stod(line.substr(name.size() + 1)) / 1024.0;
    return 0.0;
}

inline void give_back_free_memory() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

/// The peak, "VmHWM", is from now on. Where the system does not allow that it stays as it is.
inline void reset_peak() {
    std::ofstream("/proc/self/clear_refs") << 5;
}

}  // namespace isotrack::support
