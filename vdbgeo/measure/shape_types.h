// Shape index, curvedness, and the eight types of surface.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

/// Table 1 of the paper, by the signs of K and H.
enum class SurfaceType : std::uint8_t {
    peak,           ///< K > 0, H > 0
    ridge,          ///< K = 0, H > 0
    saddle_ridge,   ///< K < 0, H > 0
    flat,           ///< K = 0, H = 0
    minimal,        ///< K < 0, H = 0
    pit,            ///< K > 0, H < 0
    valley,         ///< K = 0, H < 0
    saddle_valley,  ///< K < 0, H < 0
};
constexpr std::size_t surface_type_count = 8;

const char* name_of(SurfaceType type);  ///< "saddle ridge"

/// s = −(2/π) atan2(k1 + k2, k1 − k2): −1 peak, −½ ridge, 0 saddle, ½ valley, 1 pit. Needs k1 ≥ k2; 0 for a
/// plane.
double shape_index(double k1, double k2);
/// c = √((k1² + k2²)/2), 1/Å.
double curvedness(double k1, double k2);

/// The type at tolerance `flatness` (1/Å): a principal curvature of at most this magnitude counts as 0, and
/// so does a mean curvature of at most half of it.
SurfaceType surface_type(double k1, double k2, double flatness);

/// The distribution of one quantity over a surface, each vertex with its share of the area.
struct AreaHistogram {
    double low = 0, high = 0;  ///< of the bins; what lies beyond goes into the first and last
    std::vector<double> area;  ///< Å² a bin
    double mean = 0, rms = 0;  ///< area-weighted: mean and standard deviation
    double median = 0, p05 = 0, p95 = 0;
};
AreaHistogram area_histogram(const Array<double>& values, const Array<double>& areas, std::size_t bins);

}  // namespace vdbgeo
