// Geometric flows of a density (Feng, Xia, Tong, Wei 2012, Eq 5).
#pragma once

#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo {

struct GeometricFlowOptions {
    int order = 0;             ///< q: 0 mean curvature (Laplace–Beltrami), 1 surface diffusion; 0…7
    double time = 1;           ///< ≥ 0; 0 gives the input back
    std::optional<double> dt;  ///< at most the bound; unset: 0.9 of it, found anew each step
    double fidelity = 0;       ///< β ≥ 0 of P = β (X − S) + p |∇S|
    double pressure = 0;       ///< p
    double scale = 1;  ///< density units that count as one voxel in g = 1 + |∇(∇^{2q} S)/scale|²  (> 0)

    void check() const;
};

/// S_t = (−1)^q √g ∇·(∇(∇^{2q} S)/√g) + P, g = 1 + |∇(∇^{2q}S)/scale|², explicit Euler. The face gradient in
/// 1/√g: normal difference, and the mean of the two cells' transverse central differences; √g of a voxel from
/// its central differences. |∇S| of the pressure by Godunov's upwind differences (Rouy & Tourin 1992).
/// Band-edge rule.
///
/// Bound of the step, from the coefficients as they are: 2/(G λ^q + β + 2 |p| √Σw), G the largest of
/// Gershgorin's circles 2 √g_i Σ_faces w/√g_face, λ = 4 Σ w. It is found in every step; steep places make it
/// small, a larger `scale` makes it large. A `dt` that comes to be above it is refused. The report's dt is
/// the longest step. Σ S is not kept. Errors as hyperdiffuse. Memory: 12 bytes a voxel of active leaves.
/// `share`: as for hyperdiffuse, with the halo that geometric_flow_halo tells.
HyperdiffusionReport geometric_flow(openvdb::FloatGrid& grid, const GeometricFlowOptions& options = {},
                                    const Progress& progress = {}, const stencil::Share* share = nullptr);

/// Voxels that a part needs around its own.
int geometric_flow_halo(const GeometricFlowOptions& options);

}  // namespace vdbgeo
