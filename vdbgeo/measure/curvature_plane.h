// The area of a surface over the plane of its principal curvatures.
#pragma once

#include <vector>

#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

/// Area by (k1, k2), in square cells over [low, high] × [low, high], 1/Å.
struct CurvaturePlane {
    std::size_t side = 0;      ///< cells a side
    std::vector<double> area;  ///< Å², side² of them, k1 fastest
    double low = 0, high = 0;
    double all = 0;      ///< Å²: of all vertices with a value
    double outside = 0;  ///< Å²: of those beyond the plane

    /// The cell of a value that lies in the plane.
    std::size_t cell(double k1, double k2) const;
};

/// Each vertex with its share of the area (vertex_areas has it) in the cell of its k1 and k2. The plane
/// reaches from 0 and the ½ percentile of k2 to 0 and the 99½ percentile of k1, by area, and a twentieth
/// further; ±1 where all are 0. Vertices without a value, or with no area, are left out. The same for any
/// number of threads. Throws InvalidInput where the sizes differ, an area is negative or no number, or for
/// side 0. Cost: O(n log n).
CurvaturePlane curvature_plane(const Curvatures& curvature, const Array<double>& areas, std::size_t side);

}  // namespace vdbgeo
