#include "vdbgeo/stencil/plane_kernels.h"

#include "vdbgeo/core/cpu_kernels.h"

namespace vdbgeo::stencil {

extern const Kernels baseline;
#ifdef VDBGEO_X86_KERNELS
extern const Kernels avx2;
extern const Kernels avx512;
#endif

const std::vector<const Kernels*>& available_kernels() {
#ifdef VDBGEO_X86_KERNELS
    static const auto sets = supported_kernels<Kernels>(baseline, &avx2, &avx512);
#else
    static const auto sets = supported_kernels<Kernels>(baseline, nullptr, nullptr);
#endif
    return sets;
}

const Kernels& kernels() {
    static const Kernels& chosen = choose_kernels(available_kernels());
    return chosen;
}

}  // namespace vdbgeo::stencil
