// Memory that was freed, and that the allocator keeps: for work block after block, within a limit.
#pragma once

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace vdbgeo {

/// Gives what was freed back to the system. Leaves of the next block are made by other threads, whose heaps
/// cannot use what this one's left.
inline void give_memory_back() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

/// From now on large pieces of memory go back to the system when they are freed. The allocator would keep
/// them for the next, and what comes and goes block after block, in sizes that differ a little, fits into
/// them ever less. A piece that is made anew costs its pages: not for work in memory.
inline void give_large_memory_back_at_once() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 1 << 20);  // and no more what the allocator finds best
#endif
}

}  // namespace vdbgeo
