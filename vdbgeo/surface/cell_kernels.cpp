#include "vdbgeo/surface/cell_kernels.h"

#include <cstdlib>
#include <string>

namespace vdbgeo::cell {

extern const Kernels baseline;
#ifdef VDBGEO_X86_KERNELS
extern const Kernels avx2;
extern const Kernels avx512;
#endif

const std::vector<const Kernels*>& available_kernels() {
    static const std::vector<const Kernels*> sets = [] {
        std::vector<const Kernels*> found{&baseline};
#ifdef VDBGEO_X86_KERNELS
        if (__builtin_cpu_supports("avx2")) {
            found.push_back(&avx2);
            if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw"))
                found.push_back(&avx512);
        }
#endif
        return found;
    }();
    return sets;
}

const Kernels& kernels() {
    static const Kernels& chosen = [&]() -> const Kernels& {
        if (const char* wanted = std::getenv("VDBGEO_CPU"))
            for (const Kernels* k : available_kernels())
                if (std::string(wanted) == k->name) return *k;
        return *available_kernels().back();
    }();
    return chosen;
}

}  // namespace vdbgeo::cell
