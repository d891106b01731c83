// Runs a foreign library where its crashes, endless loops and appetite for memory do no harm.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

struct IsolationLimits {
    double max_seconds = 3600;
    std::uint64_t max_bytes = 0;  ///< of memory beyond what the process has; 0: no limit
};

/// The bytes that `work` gives, computed in a child process of its own (fork), whose standard output and error
/// go nowhere. `work` must not use threads, nor anything that other threads of this process may hold.
/// Asks `progress` ten times a second whether to go on.
///
/// Throws NumericalError, beginning with `what`, where the child was killed by a signal (naming it: "crashed
/// (SIGSEGV)"), ran out of time or memory, or told an error by throwing (its message); InvalidInput where it
/// threw that; Cancelled. The child never outlives this call.
std::vector<std::byte> run_isolated(const std::function<std::vector<std::byte>()>& work,
                                    const IsolationLimits& limits, const std::string& what,
                                    const Progress& progress = {});

}  // namespace vdbgeo
