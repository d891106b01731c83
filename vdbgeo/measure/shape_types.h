// Shape index, curvedness, and the eight types of surface.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

/// Table 1 of the paper (Feng, Xia, Tong, Wei 2012, doi:10.1002/cnm.2532), by the signs of K and H. No
/// surface has K > 0 and H = 0.
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
/// plane, NaN for NaN. Koenderink & van Doorn 1992, doi:10.1016/0262-8856(92)90076-F, with the paper's sign;
/// atan2 in place of the quotient's arctan gives the umbilics, k1 = k2, their −1 and 1.
double shape_index(double k1, double k2);
/// c = √((k1² + k2²)/2), 1/Å: that of a sphere is 1/radius.
double curvedness(double k1, double k2);

/// The type at tolerance `flatness` (1/Å, 0: the bare signs): a principal curvature of at most this magnitude
/// counts as 0, and K is 0 where one of them is; where they have opposite signs a mean curvature of at most
/// half of it counts as 0 too. Needs k1 ≥ k2, and numbers: NaN has no type.
SurfaceType surface_type(double k1, double k2, double flatness);

/// A tolerance for `surface_type` that suits a surface: 0.2 of its median curvedness by area, 0 where no
/// vertex has a value. 0.2 is the quotient of principal curvatures at which Koenderink and van Doorn's scale
/// goes from ridge to peak or saddle (s = −5/8 and −3/8: tan(π/16) = 0.199), so that the bend of a typical
/// place is told from none as theirs is. Throws InvalidInput where the sizes differ. Cost: O(n log n).
double default_flatness(const Curvatures& curvature, const Array<double>& areas);

/// The area, Å², of each type of surface, in the order of SurfaceType. Undefined vertices (NaN) are left out.
/// `areas` is each vertex's share, as vertex_areas has it. Throws InvalidInput where the sizes differ, or for
/// a flatness that is not a number of at least 0.
std::array<double, surface_type_count> area_by_type(const Curvatures& curvature, const Array<double>& areas,
                                                    double flatness);

/// The distribution of one quantity over a surface, each vertex with its share of the area.
struct AreaHistogram {
    double low = 0, high = 0;  ///< of the bins: the percentiles ½ and 99½, or ±½ |value| about a single value
    std::vector<double> area;  ///< Å² a bin; what lies beyond the bins is in the first and the last
    double mean = 0, rms = 0;  ///< area-weighted: mean and standard deviation
    double median = 0, p05 = 0,
           p95 = 0;  ///< percentile p: the least value at or below which p % of the area is
};

/// Vertices with a value that is not finite, or with no area, are left out; where none is left the bins are
/// empty and the numbers NaN. The same for any number of threads. Throws InvalidInput where the sizes differ,
/// an area is negative or no number, or for 0 bins. Cost: O(n log n), 16 bytes a vertex.
AreaHistogram area_histogram(const Array<double>& values, const Array<double>& areas, std::size_t bins);

}  // namespace vdbgeo
