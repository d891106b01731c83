// Surfaces that move by their curvature, as signed distances on a narrow band.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// Normal speeds V (outward, φ_t = −V |∇φ|) in the curvatures of the surface, spheres positive: κ = k1 + k2,
/// H = κ/2, K = k1 k2. Δ_s is the Laplace–Beltrami operator.
enum class SurfaceFlow {
    mean_curvature,     ///< V = −κ: a sphere shrinks, R² = R0² − 4t
    surface_diffusion,  ///< V = Δ_s κ: volume is kept, area falls; spheres are stationary
    willmore  ///< V = Δ_s H + 2 H (H² − K), the gradient flow of ∫H²: spheres are stationary, tori move
              ///< to the ratio √2
};

struct LevelSetFlowOptions {
    SurfaceFlow flow = SurfaceFlow::mean_curvature;
    double time = 1;  ///< voxel² for mean_curvature, voxel⁴ for the others; ≥ 0, 0 gives the input back
    std::optional<double> dt;  ///< unset: chosen by the flow. Mean curvature: at most 1/6
    int half_width = 0;  ///< of the band that is written, in voxels, 2…20; 0: as the grid's, at most 20

    void check() const;
};

struct LevelSetFlowReport {
    double dt = 0, time = 0;  ///< the longest step; the flow's time at the end
    int steps = 0;
    std::uint64_t active_voxels = 0;             ///< at the end
    double volume_before = 0, volume_after = 0;  ///< voxel³, of the inside
    bool vanished = false;                       ///< nothing is left
};

/// Moves the zero level of `grid`, a level set with cubic voxels (class level set, negative inside, values in
/// world units as OpenVDB has them), and keeps it a signed distance on a band that follows it: the topology
/// may change. Time is in voxels whatever the voxel size.
///
/// Mean curvature: φ_t = |∇φ| κ by central differences and explicit steps of 0.15 voxel², distances anew
/// every five steps. The others: V at the surface by the closest point method, and the semi-implicit step of
/// Smereka (2003), (I + dt S Δ²) φ⁺ = φ − dt V + dt S Δ² φ, with S the coefficient of Δ_s² in V, solved on
/// the band by conjugate gradients; distances anew every step. Unset, dt is such that the surface moves 0.1
/// voxel a step, and 0.25…256 voxel⁴: first order, features that move less than that are slower than they
/// ought to be. Curvatures beyond 1/voxel and speeds beyond 0.4 are cut. Surface diffusion: what the volume
/// drifts in a step is taken back by moving the whole surface evenly, so that of several components only the
/// sum is kept. Accurate for radii of 6 voxels and more. While it works the band is 6 voxels wide on either
/// side.
///
/// Throws InvalidInput for a grid of another class, with voxels that are not cubic or values that are not
/// finite, for a dt above the bound; NumericalError where it diverges; Cancelled. The grid is written to at
/// the end only; its metadata stay. Without active voxels it is left as it is, with `vanished`. The same bits
/// for any number of threads.
LevelSetFlowReport level_set_flow(openvdb::FloatGrid& grid, const LevelSetFlowOptions& options = {},
                                  const Progress& progress = {});

}  // namespace vdbgeo
