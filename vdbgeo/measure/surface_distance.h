// How far two surfaces are from each other.
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct SurfaceDistanceOptions {
    /// Å. A face is cut into n² similar parts whose sides are no longer than this, and the centre of each
    /// part is a sample; the corners of faces are always samples too. Unset: half of the mean edge of the
    /// mesh that is sampled.
    std::optional<double> spacing;

    /// Throws InvalidInput unless the spacing is a finite number above 0.
    void check() const;
};

/// Distances from samples on one surface to the nearest points of another, Å.
struct OneSidedDistance {
    double max = 0;            ///< over all samples
    double mean = 0, rms = 0;  ///< over the area: a sample in a face counts with its part of the face
    double p999 = 0;           ///< 99.9 % of all samples are within it, from above to 1 in 4000
    std::uint64_t samples = 0;
};

struct SurfaceDistance {
    OneSidedDistance forward, backward;  ///< from a to b, from b to a
    double hausdorff = 0;                ///< the larger of the two maxima
};

/// The two-sided distance of Cignoni, Rocchini & Scopigno 1998 (doi:10.1111/1467-8659.00236), by samples that
/// are a function of the mesh alone. The true Hausdorff distance is at least `hausdorff` and at most two
/// thirds of the spacing more, for no point of a surface is further than that from a sample. Points that no
/// face names are no part of a surface. Throws InvalidInput for a mesh without faces or without any area, and
/// for a spacing that would take over 10^10 samples. About half a microsecond a sample, in parallel; the same
/// bytes for any number of threads.
SurfaceDistance surface_distance(const TriMesh& a, const TriMesh& b,
                                 const SurfaceDistanceOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
