#include "vdbgeo/measure/curvature_plane.h"

#include <algorithm>
#include <cmath>

#include "vdbgeo/measure/shape_types.h"

namespace vdbgeo {

std::size_t CurvaturePlane::cell(double k1, double k2) const {
    const auto along = [&](double k) {
        const double at = (k - low) / (high - low) * static_cast<double>(side);
        return static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(side - 1)));
    };
    return along(k2) * side + along(k1);
}

CurvaturePlane curvature_plane(const Curvatures& curvature, const Array<double>& areas, std::size_t side) {
    const AreaHistogram lower = area_histogram(curvature.k2, areas, side),
                        upper = area_histogram(curvature.k1, areas, side);
    CurvaturePlane plane;
    plane.side = side;
    plane.area.assign(side * side, 0.0);
    plane.low = std::min(0.0, lower.low);
    plane.high = std::max(0.0, upper.high);
    if (!(plane.low < plane.high)) plane.low = -1, plane.high = 1;
    const double further = (plane.high - plane.low) / 20;
    plane.low -= further;
    plane.high += further;
    for (std::size_t v = 0; v < curvature.size(); ++v) {
        const double k1 = curvature.k1[v], k2 = curvature.k2[v];
        if (!curvature.defined(v) || !std::isfinite(k1) || !std::isfinite(k2)) continue;
        plane.all += areas[v];
        if (std::min(k1, k2) < plane.low || std::max(k1, k2) >= plane.high)
            plane.outside += areas[v];
        else
            plane.area[plane.cell(k1, k2)] += areas[v];
    }
    return plane;
}

}  // namespace vdbgeo
