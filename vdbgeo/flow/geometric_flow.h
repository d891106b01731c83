// Geometric flows of a density (Feng, Xia, Tong, Wei 2012, Eq 5).
#pragma once

#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo {

struct GeometricFlowOptions {
    int order = 0;            ///< q: 0 mean curvature (Laplace–Beltrami), 1 surface diffusion; 0…7
    double time = 1;          ///< ≥ 0; 0 gives the input back
    std::optional<double> dt; ///< at most the bound; unset: 0.9 of it, found anew each step
    double fidelity = 0;      ///< β ≥ 0 of P = β (X − S) + p |∇S|
    double pressure = 0;      ///< p
    double scale = 1;         ///< density units that count as one voxel in g = 1 + |∇(∇^{2q} S)/scale|²  (> 0)

    void check() const;
};

/// S_t = (−1)^q √g ∇·(∇(∇^{2q} S)/√g) + P, g = 1 + |∇(∇^{2q}S)/scale|², explicit Euler. The face gradient in
/// 1/√g: normal difference, and the mean of the two cells' transverse central differences. Band-edge rule.
/// Errors as hyperdiffuse.
HyperdiffusionReport geometric_flow(openvdb::FloatGrid& grid, const GeometricFlowOptions& options = {},
                                    const Progress& progress = {});

}  // namespace vdbgeo
