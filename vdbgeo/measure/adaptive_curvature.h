// The method for meshes of which nothing is known: it finds the scale by itself.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

struct AdaptiveCurvatureOptions {
    std::optional<double> radius;  ///< of the neighbourhoods, Å; none: chosen from the mesh
    void check() const;
};

struct AdaptiveCurvature : Curvatures {
    double radius = 0;  ///< the radius used, Å; the median where it varies
};

/// The default of `vdbgeo curvature`: right on clean, on marching-cubes and on voxel-like meshes without
/// being told which.
AdaptiveCurvature adaptive_curvature(const TriMesh& mesh, const AdaptiveCurvatureOptions& options = {},
                                     const Progress& progress = {});

}  // namespace vdbgeo
