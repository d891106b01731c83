// How far two surfaces are from each other.
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct SurfaceDistanceOptions {
    /// Samples on the faces lie about this far apart, in Å; vertices are always samples. Unset: a third of the
    /// mesh's mean edge.
    std::optional<double> spacing;

    void check() const;
};

/// Distances from samples on one surface to the nearest points of another, Å.
struct OneSidedDistance {
    double max = 0, mean = 0, rms = 0, p999 = 0;  ///< p999: 99.9 % of the samples are within it
    std::uint64_t samples = 0;
};

struct SurfaceDistance {
    OneSidedDistance forward, backward;  ///< from a to b, from b to a
    double hausdorff = 0;                ///< the larger of the two maxima
};

SurfaceDistance surface_distance(const TriMesh& a, const TriMesh& b, const SurfaceDistanceOptions& options = {},
                                 const Progress& progress = {});

}  // namespace vdbgeo
