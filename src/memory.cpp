#include "isotrack/memory.h"

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace isotrack {

void keep_little_memory() {
#ifdef __GLIBC__
    // Fixed: else the first large block that is freed makes all that are no larger stay.
    mallopt(M_MMAP_THRESHOLD, 1 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 24);
#endif
}

}  // namespace isotrack
