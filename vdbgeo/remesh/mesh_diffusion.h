// Surface diffusion on a mesh: smooth, and the volume stays.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// How long the surface flows, and in how many steps. Waves of length w decay as exp(−(2π/w)⁴ time).
struct MeshDiffusionOptions {
    double time = 0;  ///< Å⁴; 0 gives the input back
    int steps = 1;    ///< each solves one linear system; more follow the flow more closely

    /// Throws InvalidInput unless time is finite and not below 0, and there is a step at least.
    void check() const;
};

/// The flow with normal velocity Δ_Γ κ, κ = k1 + k2 positive on spheres (Mullins 1957,
/// doi:10.1063/1.1722742): it lowers the area and keeps the volume, and spheres rest. A step moves each
/// vertex along its normal by w from
///     (M + dt·L M⁻¹ L) w = −dt·L κ,      κ = M⁻¹ n·(L x),
/// with the cotangent stiffness L and as mass M the length of a vertex's area vector, whose direction is n:
/// then Σ M w = 0, which is the volume to first order. (Solving for x itself with the same matrix would
/// shrink spheres: on them Δ²x is not 0.) The matrix is linearised in the step and unconditionally stable;
/// vertices do not move along the surface.
///
/// The mesh has to be oriented alike throughout, closed or open. Vertices on borders, on edges of more than
/// two faces and on the rims of caps stay, and nothing flows over them. Faces without an area have no say.
/// Connectivity and properties are untouched. Throws InvalidInput for a mesh that `check` refuses,
/// NumericalError where the system cannot be solved; Cancelled. The same bytes for any number of threads (one
/// is used). A sparse factorisation each step: about 20 µs and 2 KB a vertex.
TriMesh mesh_diffusion(const TriMesh& mesh, const MeshDiffusionOptions& options,
                       const Progress& progress = {});

}  // namespace vdbgeo
