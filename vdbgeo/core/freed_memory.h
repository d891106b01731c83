// Memory that was freed, and that the allocator keeps.
#pragma once

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace vdbgeo {

/// Gives what was freed back to the system. For work block after block, within a limit: leaves of the next
/// block are made by other threads, whose heaps cannot use what this one's left.
inline void give_memory_back() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

}  // namespace vdbgeo
