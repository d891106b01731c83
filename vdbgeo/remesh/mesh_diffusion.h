// Surface diffusion on a mesh: smooth, and the volume stays.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// x_t = −Δ_Γ(2H) n, semi-implicit (M + dt·L M⁻¹ L) x⁺ = M x with cotangent L and mass M.
struct MeshDiffusionOptions {
    double time = 0;  ///< Å⁴; 0 gives the input back
    int steps = 1;

    void check() const;
};

TriMesh mesh_diffusion(const TriMesh& mesh, const MeshDiffusionOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
