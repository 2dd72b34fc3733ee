// What the process keeps of the memory it has used.
#pragma once

namespace isotrack {

/// Makes the allocator keep freed blocks of up to 32 MB for the next stage, and give larger ones back to the
/// system, as well as what is free beyond 64 MB: a tenth to a fifth less memory than by its own thresholds,
/// which go with the blocks that are freed. And lets there be half as many heaps as cores, one at least,
/// so that threads share what they free: another tenth, on two cores. Both at the same speed, but for reading
/// beside other work, which takes a quarter longer. It holds for the whole process, whatever its environment
/// says, so it is for programs to call, at their start, before there are threads; the library never does.
/// Without effect where the C library is not glibc.
void keep_little_memory();

}  // namespace isotrack
