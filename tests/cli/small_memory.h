// Damaged files must not cost memory or time, whatever they claim.
#pragma once

#include "tests/cli/cli_test.h"

namespace vdbgeo::test {

/// Two seconds of processor time, and half a gigabyte of data: what a header claims cannot even be reserved.
inline RunOptions small_memory() {
    RunOptions options;
    if (!sanitized) options.limits = {{RLIMIT_CPU, 2}, {RLIMIT_DATA, 512u << 20}};
    return options;
}

inline void expect_small(const Ended& r) {
    if (sanitized) return;
    EXPECT_LT(r.peak_bytes, 100'000'000u);
}

}  // namespace vdbgeo::test
