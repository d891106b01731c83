// Edges as the difference of two coupled diffusions (Feng, Xia, Tong, Wei 2012, Eqs 6–8).
#pragma once

#include <vector>

#include "vdbgeo/flow/cycles.h"
#include "vdbgeo/flow/diffusion_fields.h"
#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo {

struct HighPassOptions {
    int order = 0;             ///< q of both operators
    double slow = 0;           ///< d_10 ≥ 0 of u
    double fast = 1;           ///< d_20 ≥ d_10 of v
    double coupling_u = 0.02;  ///< ε_u ≥ 0
    double coupling_v = 0.02;  ///< ε_v ≥ 0
    EdgeScale sigma;
    double time = 10;          ///< ≥ 0
    std::optional<double> dt;  ///< Euler's step; at most the bound
    Stepper stepper = Stepper::fsi;
    std::optional<int> cycle;  ///< steps in a cycle of frozen coefficients, 1…300; unset: they grow

    void check() const;
    /// All of them, exactly, in one line: what a checkpoint has to agree with.
    std::string text() const;
};

/// u_t = F1(u) + ε_u (v − u), v_t = F2(v) + ε_v (u − v), u = v = X at 0; the grid's active values become the
/// edges w = u − v. F1 and F2 are hyperdiffusion operators with d_10 and d_20. Bound of the step:
/// 2 / (d_20 λ^{q+1} + ε_u + ε_v). Neutral: d_10 = d_20 gives 0 everywhere, and so does a constant.
/// Errors as hyperdiffuse. Memory: 24 to 28 bytes a voxel of active leaves.
/// `share`: as for hyperdiffuse, with the halo that high_pass_halo tells.
/// `checkpoint`: CheckpointedSolver tells more.
HyperdiffusionReport coupled_high_pass(openvdb::FloatGrid& grid, const HighPassOptions& options = {},
                                       const Progress& progress = {}, const stencil::Share* share = nullptr,
                                       const CheckpointOptions& checkpoint = {});

/// Voxels that a part needs around its own.
int high_pass_halo(const HighPassOptions& options);

/// u and v, for a solver, and the cycles that it takes.
std::vector<DiffusionProblem::Field> high_pass_fields(const HighPassOptions& options);
void take_high_pass_cycles(CycleSolver& solver, const HighPassOptions& options, double step,
                           HyperdiffusionReport& report, const Progress& progress);

}  // namespace vdbgeo
