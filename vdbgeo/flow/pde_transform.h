// The PDE transform: a map as a sum of modes, from fine to coarse (Wang, Wei, Yang 2012).
#pragma once

#include <functional>
#include <vector>

#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo {

struct TransformOptions {
    /// One low-pass P_k a mode: order q_k and time t_k; t_k ≥ 0.
    struct Pass {
        int order = 1;
        double time = 1;
    };
    std::vector<Pass> passes{{1, 1.0}, {1, 16.0}, {1, 256.0}};
    EdgeScale sigma{EdgeScale::Kind::infinite, 2, 0, 1};
    Stepper stepper = Stepper::fsi;

    void check() const;
};

/// Receives a mode, or last the residue; the grid is handed over.
using ModeSink =
    std::function<void(int index, openvdb::FloatGrid::Ptr mode, const HyperdiffusionReport& report)>;

/// r_0 = X; mode_k = r_k − P_k r_k; r_{k+1} = P_k r_k. `sink` is called for each mode in order and for the
/// last residue (index = number of passes). Their sum is X to rounding. One mode is in memory at a time.
void pde_transform(const openvdb::FloatGrid& grid, const TransformOptions& options, const ModeSink& sink,
                   const Progress& progress = {});

}  // namespace vdbgeo
