// Hyperdiffusion of any order: edge-keeping noise removal (Feng, Xia, Tong, Wei 2012, Eqs 1–4).
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/types.h"
#include "vdbgeo/flow/checkpoint_options.h"
#include "vdbgeo/stencil/share.h"

namespace vdbgeo {

/// σ of Eqs 3 and 4, the gradient above which an edge is kept.
struct EdgeScale {
    enum class Kind { local, global, value, infinite };
    Kind kind = Kind::local;
    int radius = 2;     ///< local: variance over the (2r+1)³ window, r 1…8
    double value = 0;   ///< value: σ itself, in density units a voxel (> 0)
    double factor = 1;  ///< multiplies the local or global σ (> 0)

    /// "local", "local:R", "global", "inf" or a number; InvalidInput for anything else.
    static EdgeScale parse(const std::string& text);
    std::string text() const;
    /// Throws InvalidInput for values out of range.
    void check() const;
};

/// One term of Eq 2: ∇·(d_q ∇∇^{2q} u), d_q = (−1)^q d_q0 exp(−|∇u|²/2σ_q²).
struct DiffusionTerm {
    int order = 0;           ///< q, 0…15
    double diffusivity = 1;  ///< d_q0 > 0, in voxel^{2q+2} per unit of time
};

enum class Stepper {
    fsi,    ///< fast semi-iterative cycles (Hafner, Ochs, Weickert, Reißel, Grewenig 2016)
    euler,  ///< explicit
    adi     ///< semi-implicit, one line solve an axis; far above the bound stable in boxes alone
};

struct HyperdiffusionOptions {
    std::vector<DiffusionTerm> terms =
        std::vector<DiffusionTerm>(1, DiffusionTerm{1, 1.0});  ///< orders differ
    EdgeScale sigma{EdgeScale::Kind::global, 2, 0, 1};
    /// Diffusion time, ≥ 0; 0 gives the input back. Unset, with `steps` unset too: until the root mean square
    /// of X − u reaches the noise (removable_noise), the discrepancy principle, or for 320 steps, 150 of more
    /// than 64 million voxels.
    std::optional<double> time;
    std::optional<int> steps;  ///< applications of the operator; with `dt`, instead of `time`
    std::optional<double> dt;  ///< step; at most the stability bound. Unset: 0.9 of it
    Stepper stepper = Stepper::fsi;
    std::optional<int> cycle;  ///< steps in a cycle of frozen coefficients, at most, 1…300; unset: they grow
    int min_cycles = 3;        ///< cycles at least, so that σ and d follow u, and fine noise is damped well
    double fidelity = 0;       ///< β ≥ 0 of e = β (X − u)

    /// Throws InvalidInput for values out of range and for options that exclude each other.
    void check() const;
    /// Σ d_q0 λ^{q+1} + β with λ = 4 Σ w_a, the largest rate of decay; explicit steps are stable up to 2 over
    /// it.
    double largest_rate(const Vec3d& weights) const;
    /// All of them, exactly, in one line: what a checkpoint has to agree with.
    std::string text() const;
};

struct HyperdiffusionReport {
    std::uint64_t active_voxels = 0;
    double dt = 0, time = 0;
    int steps = 0, cycles = 0;
    double mean_before = 0, mean_after = 0;
    double noise = 0;              ///< estimated standard deviation of the noise, where it was asked for
    double removed = 0;            ///< root mean square of X − u
    bool automatic = false;        ///< the time was chosen here
    std::size_t state_bytes = 0;   ///< memory of fields and tables beside the grid
    std::uint64_t bytes_sent = 0;  ///< to other members of the team
    int resumed_cycles = 0;        ///< cycles that were taken before, by a run that left a checkpoint
    std::size_t blocks = 0;        ///< that the map was cut into; 0: none
};

/// w_a = (h_min / h_a)² of the axes of a grid's transform: 1 for cubic voxels.
Vec3d axis_weights(const openvdb::math::Transform& transform);

/// Solves u_t = −Σ_q L_{d_q} L^q u + β (X − u) from u = X, the grid's active values, up to the time asked
/// for. L = −Δ_h with the band-edge rule: no flux between an active and an inactive voxel. Coefficients are
/// evaluated at the start of each cycle (fsi) or step (euler). Σu is kept to rounding. Without a maximum
/// principle for q ≥ 1: values may go beyond the input's range. Inactive voxels are not touched.
///
/// Throws InvalidInput for bad options, values that are not finite, a dt above the bound; NumericalError
/// where the values or their mean diverge; Cancelled. The grid is only written to at the end. Memory: 12 to
/// 16 bytes a voxel of active leaves for one order. Cost: docs/performance.md.
///
/// `share`: the grid is one member's part of a larger one, with the halo that hyperdiffusion_halo tells; all
/// members call this with the same options. The own voxels then get the bits that they would get in one grid
/// of all parts; ghosts are left as they were. Not with Stepper::adi.
///
/// `checkpoint`: CheckpointedSolver tells more.
HyperdiffusionReport hyperdiffuse(openvdb::FloatGrid& grid, const HyperdiffusionOptions& options = {},
                                  const Progress& progress = {}, const stencil::Share* share = nullptr,
                                  const CheckpointOptions& checkpoint = {});

/// Voxels that a part needs around its own.
int hyperdiffusion_halo(const HyperdiffusionOptions& options);

}  // namespace vdbgeo
