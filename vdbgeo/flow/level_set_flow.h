// Surfaces that move by their curvature, as signed distances on a narrow band.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

enum class SurfaceFlow {
    mean_curvature,     ///< normal speed −H·2 (sum of the principal curvatures): a sphere shrinks, R² = R0² − 4t
    surface_diffusion,  ///< normal speed Δ_s of the mean curvature: volume is kept
    willmore            ///< gradient flow of ∫H²: spheres are stationary, tori move to the ratio √2
};

struct LevelSetFlowOptions {
    SurfaceFlow flow = SurfaceFlow::mean_curvature;
    double time = 1;           ///< voxel² for mean_curvature, voxel⁴ for the others; ≥ 0, 0 gives the input back
    std::optional<double> dt;  ///< unset: from the bound of the scheme
    int half_width = 0;        ///< of the band in voxels; 0: what the flow needs

    void check() const;
};

struct LevelSetFlowReport {
    double dt = 0, time = 0;
    int steps = 0;
    std::uint64_t active_voxels = 0;           ///< at the end
    double volume_before = 0, volume_after = 0;  ///< voxel³, of the inside
    bool vanished = false;                     ///< nothing is left
};

/// Moves the zero level of `grid`, a level set with cubic voxels (class level set, negative inside, values in
/// world units as OpenVDB has them), and keeps it a signed distance on a band that follows it: the topology may
/// change. Throws InvalidInput for a grid of another class or with voxels that are not cubic; NumericalError
/// where it diverges; Cancelled. The grid is written to at the end only.
LevelSetFlowReport level_set_flow(openvdb::FloatGrid& grid, const LevelSetFlowOptions& options = {},
                                  const Progress& progress = {});

}  // namespace vdbgeo
