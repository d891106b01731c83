// First and second derivatives of a map, as grids to colour and to move things by.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct DerivativeOptions {
    /// Only those of the active voxels that are active here too, index for index; unset: all.
    openvdb::BoolGrid::ConstPtr within;
};

/// ∇u by central differences (second order) on the active voxels of the map, per Å along the world's x, y, z,
/// in skewed and anisotropic frames too: a grid `gradient` of covariant vectors. It points to where the
/// density grows: into the particle, against the surface's normal. (In a level set, negative inside, it
/// points outward.)
///
/// Neighbours that are not active count with the value that they are stored with, those outside the box as
/// background. Cost: one pass over the active voxels, 12 bytes each; Cancelled.
openvdb::Vec3SGrid::Ptr gradient(const DensityMap& map, const DerivativeOptions& options = {},
                                 const Progress& progress = {});

/// Mean curvature of the level set of u that passes through each active voxel, in 1/Å: H = ½ ∇·n with the
/// outward normal n = -∇u/|∇u| (from dense to empty), so that a dense ball of radius R has H = +1/R and a
/// pocket H < 0; 0 where the gradient vanishes. For a level set (negative inside) n = ∇φ/|∇φ|, and the sign
/// means the same. Second differences (Goldman 2005, doi:10.1016/j.cagd.2005.06.005, eq. 4.2) as OpenVDB
/// makes them, in world space: a grid `mean_curvature`. Noise is amplified twice: smooth the map first.
///
/// Neighbours and cost as for the gradient. Cancelled.
openvdb::FloatGrid::Ptr mean_curvature(const DensityMap& map, const DerivativeOptions& options = {},
                                       const Progress& progress = {});

}  // namespace vdbgeo
