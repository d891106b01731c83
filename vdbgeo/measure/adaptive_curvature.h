// The method for meshes of which nothing is known: it finds the scale by itself.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

struct AdaptiveCurvatureOptions {
    std::optional<double> radius;  ///< of the neighbourhoods, Å; none: chosen from the mesh
    /// Throws InvalidInput unless the radius is finite and above 0.
    void check() const;
};

struct AdaptiveCurvature : Curvatures {
    double radius = 0;  ///< the radius used, Å; the median where it varies
};

/// The default of `vdbgeo curvature`: right on clean, on marching-cubes and on voxel-like meshes without
/// being told which. Three steps:
///
/// 1. Where 95 % of the vertices lie on the edges of a grid along the axes, the errors of the grid are undone
///    for the fits: the sag of linear interpolation along edges, −½ t(1 − t) h² f_aa/|∇f|, whose curvature
///    part is the surface's own and whose rest is fitted; and the inset of a mask whose outermost nodes were
///    joined, half a step max|n_a|, taken outwards: the curvature is that of the mask, not of its nodes.
/// 2. Around each vertex a jet of degree 2 or 4 is fitted by weighted least squares (Cazals & Pouget 2005,
///    doi:10.1016/j.cagd.2004.09.004), over the sphere that osculates the neighbourhood in place of the
///    tangent plane: the conformal map of space that takes this sphere to the plane keeps k1 − k2 and the
///    directions and takes its curvature off both (spheres come out exact at any radius). Weights are areas
///    times (1 − d²/r²)² times the cosine between normals; what faces away is left out.
/// 3. The radius, 2.4 to 27 mesh spacings, and the degree are one choice for the mesh: those at which the
///    estimates at 512 vertices change least, in proportion, when the radius grows by √2 (95 % quantile;
///    after Lepski 1991, doi:10.1137/1135065). Noise falls with r³ and bias grows with r², so the change is
///    about the error. The spacing follows the mesh where it has no grid. From 9.6 spacings on, fits are
///    made at vertices r/8 apart and shape operators averaged between them (wide_fits.h).
///
/// Borders are fitted from their one side; where the points do not determine a jet the neighbourhood grows,
/// and pieces of a few faces get the curvature of a sphere. Undefined stays what curvature_flags says, and
/// what has fewer than four points that determine a sphere. Throws InvalidInput as curvature_flags does.
/// Takes 3 µs a face of a thread at clean surfaces and 10 µs at the widest radius; 80 bytes a face.
AdaptiveCurvature adaptive_curvature(const TriMesh& mesh, const AdaptiveCurvatureOptions& options = {},
                                     const Progress& progress = {});

}  // namespace vdbgeo
