// What the process keeps of the memory it has used.
#pragma once

namespace isotrack {

/// Makes the allocator give large blocks back to the system when they are freed instead of keeping them for
/// later: a quarter less memory for a few percent more time. It holds for the whole process, so it is for
/// programs to call, at their start; the library never does. Without effect where the C library is not glibc.
void keep_little_memory();

}  // namespace isotrack
