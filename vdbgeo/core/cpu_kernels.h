// Which of several builds of the same loops this CPU runs.
#pragma once

#include <cstdlib>
#include <string>
#include <vector>

namespace vdbgeo {

/// The sets that this CPU can run, the plainest first. `avx2` (x86-64-v3) and `avx512` (x86-64-v4) are null
/// where they are not built. A set has a `name`.
template <class Kernels>
std::vector<const Kernels*> supported_kernels(const Kernels& baseline, const Kernels* avx2,
                                              const Kernels* avx512) {
    std::vector<const Kernels*> found{&baseline};
#if defined(__x86_64__)
    if (avx2 && __builtin_cpu_supports("avx2")) {
        found.push_back(avx2);
        if (avx512 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
            __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw"))
            found.push_back(avx512);
    }
#else
    static_cast<void>(avx2), static_cast<void>(avx512);
#endif
    return found;
}

/// The last of them, or the one that the environment variable VDBGEO_CPU names.
template <class Kernels>
const Kernels& choose_kernels(const std::vector<const Kernels*>& available) {
    if (const char* wanted = std::getenv("VDBGEO_CPU"))
        for (const Kernels* k : available)
            if (std::string(wanted) == k->name) return *k;
    return *available.back();
}

}  // namespace vdbgeo
