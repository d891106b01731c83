#include "vdbgeo/measure/shape_types.h"

#include <cmath>

namespace vdbgeo {

const char* name_of(SurfaceType type) {
    static constexpr const char* names[] = {"peak", "ridge",  "saddle ridge", "flat", "minimal surface",
                                            "pit",  "valley", "saddle valley"};
    return names[static_cast<std::size_t>(type)];
}

double shape_index(double k1, double k2) {
    if (k1 == 0 && k2 == 0) return 0;
    return -2 / M_PI * std::atan2(k1 + k2, k1 - k2);
}

double curvedness(double k1, double k2) { return std::sqrt(0.5 * (k1 * k1 + k2 * k2)); }

SurfaceType surface_type(double k1, double k2, double flatness) {
    const auto sign = [](double k, double bound) { return k > bound ? 1 : k < -bound ? -1 : 0; };
    const int a = sign(k1, flatness), b = sign(k2, flatness), gaussian = a * b;
    const int mean = sign(0.5 * (k1 + k2), 0.5 * flatness);
    if (gaussian > 0) return a > 0 ? SurfaceType::peak : SurfaceType::pit;
    if (gaussian < 0)
        return mean > 0   ? SurfaceType::saddle_ridge
               : mean < 0 ? SurfaceType::saddle_valley
                          : SurfaceType::minimal;
    if (a == 0 && b == 0) return SurfaceType::flat;
    return a + b > 0 ? SurfaceType::ridge : SurfaceType::valley;
}

}  // namespace vdbgeo
