// Curvature of the density itself at the vertices of its surface.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct FieldCurvatureOptions {
    /// Standard deviation σ of the gaussian that the density is seen through, in voxels (of the finest axis),
    /// 0.5 to 12. None: chosen from the map, see field_curvature.
    std::optional<double> scale;
    /// The grid is negative inside (a level set, a map that was negated): the sign of everything turns.
    bool level_set = false;
    void check() const;
};

struct FieldCurvature : Curvatures {
    double scale = 0;  ///< used, in voxels
};

/// Curvature of the level set of the smooth density through each vertex, with directions. With the gradient g
/// and the Hessian Q of the density seen through a gaussian, in world coordinates, n = −g/|g| (dense inside;
/// +g/|g| for level sets) and P = I − nnᵀ, the shape operator is ∇n = −PQP/|g| (or +); its eigenvalues on the
/// tangent plane are k1 and k2, and K and H come from these (Goldman 2005,
/// doi:10.1016/j.cagd.2005.06.005, §4).
///
/// **Derivatives** are taken at the vertex itself, by sums over the samples around it (GaussianWindow): exact
/// for quadratics at any place between the samples. A gaussian with σ above 2 voxels smooths the samples
/// first (SmoothedView). Sheared frames: the gaussian's axes are the grid's. An axis with coarser samples
/// than the finest has at least 0.7 of its own. Since a gaussian bends a surface by O((σk)²), errors fall
/// with the square of the voxel where the density is smooth. Spheres keep their curvature at any σ.
///
/// **Limit**: k is given as k / (1 + (σk)⁴)^¼: no more than 1/σ, what a gaussian of width σ can tell, where
/// |g| comes near 0 beside a feature that it wiped out; 0.1 % less than k at σk = 1/4, 16 % at 1.
///
/// **Scale** when none is given: the smallest of 1, 1.5, 2, 2.5, 3, 4 voxels at which, at up to 2300 vertices
/// of 96 blocks, half a voxel along the surface changes k1 and k2 by under 1.5 % of their mean square (Σ|Δk|²
/// against Σ|k|² of both places); but none that moves the surface by more than a quarter of a voxel (median
/// of the change of the density over its slope), since what it shows is then the curvature of another body:
/// 0.7 where 1 does so already, and where none is steady the steadiest of the others. Clean maps get 1. A
/// mask (at most three values around nine of ten blocks) gets 5. Each mesh chooses its own: give the scale
/// where two meshes are to be compared. docs/accuracy.md has what scales do to real maps.
///
/// Masks: median and 95 % error of k1 of a ball of ones among zeros, of 10 voxels' radius 6.9 and 17 % at
/// scale 2, 1.4 and 3.8 % at 4, 1.5 and 4.0 % at 5, 2.6 and 5.3 % at 6; of 30 voxels' 16 and 54 %, 2.1 and
/// 6.1 %, 1.2 and 3.2 %, 0.8 and 2.2 %.
///
/// **Samples** outside the box of a bounded map have no weight: derivatives become one-sided there, still
/// exact for quadratics, and noisier. What the sparse grid dropped reads as stored (background, inactive
/// value): a map that was cut at a threshold bends near the cut, within 4σ. Undefined are vertices with a
/// sample in reach (4σ, 4 voxels at least) that is not finite, vertices more than half a voxel outside the
/// box, all where an axis has fewer than three samples, and places without a slope: σ|g| below the rounding
/// of 32-bit floats, |g| below 1e-6 σ|Q|; and those that curvature_flags says. The sign is the map's: faces
/// that are turned over do not matter.
///
/// Throws as curvature_flags, and InvalidInput for a scale out of range; Cancelled. Cost a vertex and thread:
/// 1.1 µs at scale 1, 1.9 at 1.5, 3.5 at 2, 6.5 at 3, 9 at 4, growing as σ² where there is a vertex in most
/// cells, because the samples of a block are smoothed once for all its vertices; memory 16 bytes a vertex
/// beside the result, and per thread a dense block.
FieldCurvature field_curvature(const TriMesh& mesh, const DensityMap& map,
                               const FieldCurvatureOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
