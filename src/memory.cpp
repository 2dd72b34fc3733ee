#include "isotrack/memory.h"

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace isotrack {

void keep_little_memory() {
#ifdef __GLIBC__
    // What is used anew in each stage had better not come from the system each time, page by page: blocks up
    // to the largest that may be kept are. Fixed, else both thresholds go with the blocks that are freed.
    mallopt(M_MMAP_THRESHOLD, 1 << 25);
    mallopt(M_TRIM_THRESHOLD, 1 << 26);
#endif
}

}  // namespace isotrack
