// Curvature of the density itself at the vertices of its surface.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct FieldCurvatureOptions {
    /// Standard deviation of the gaussian that the density is seen through, in voxels (of the finest axis).
    /// None: chosen, see field_curvature.
    std::optional<double> scale;
    bool level_set = false;  ///< the grid is negative inside
    void check() const;
};

struct FieldCurvature : Curvatures {
    double scale = 0;  ///< used, in voxels
};

/// Curvature of the level set of the smooth density through each vertex, from gradient and Hessian (Goldman
/// 2005, doi:10.1016/j.cagd.2005.06.005).
FieldCurvature field_curvature(const TriMesh& mesh, const DensityMap& map,
                               const FieldCurvatureOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
