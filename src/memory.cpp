#include "isotrack/memory.h"

#include <algorithm>
#include <cstdlib>
#include <thread>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace isotrack {

void keep_little_memory() {
#ifdef __GLIBC__
    // What a thread has freed is of no use to those with another arena. With one for two cores threads seldom
    // wait for each other.
    mallopt(M_ARENA_MAX, std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / 2));
    // What is used anew in each stage had better not come from the system each time, page by page: blocks up
    // to the largest that may be kept are. Fixed, else both thresholds go with the blocks that are freed.
    mallopt(M_MMAP_THRESHOLD, 1 << 25);
    mallopt(M_TRIM_THRESHOLD, 1 << 26);
#endif
}

}  // namespace isotrack
