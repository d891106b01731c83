// What hyperdiffusion, the coupled high-pass and the PDE transform share: fields on bricks that are stepped
// in cycles of frozen coefficients.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "vdbgeo/flow/hyperdiffusion.h"
#include "vdbgeo/stencil/diffusion_sweep.h"
#include "vdbgeo/stencil/ghost_exchange.h"

namespace vdbgeo {

/// Cycles of n steps of τ each.
struct CycleRun {
    int cycles = 0, n = 0;
    double tau = 0;
};

/// Relaxation factors α_k = (4k+2)/(2k+3) of a cycle.
double fsi_relaxation(int k);
/// Time that a cycle of n steps of τ advances: τ n (n+1)/3 with FSI, n τ else.
double cycle_time(Stepper stepper, int n, double tau);
/// How a time is divided into cycles.
struct CycleRule {
    int order = 0;               ///< the highest order there is
    std::optional<int> longest;  ///< cycles of one length, of at most this many steps; unset: they grow
    int least = 1;               ///< cycles at least
};
/// Steps of the k-th growing cycle. The first smooths over about two voxels, so that the noise no longer
/// hides the edges when the coefficients are next found; then there is less and less that they have to
/// follow: the length grows by a quarter (order 0) or doubles, up to 300 steps.
int growing_cycle(int order, int k);
/// The cycles that take a time with FSI, with steps of at most `largest`; for other steppers cycles of one
/// step.
std::vector<CycleRun> cycles_for_time(Stepper stepper, double time, double largest, const CycleRule& rule);
/// How far around its own cells, in voxels and whole leaves, a member of a team has to have a grid.
int diffusion_halo(const std::vector<DiffusionTerm>& terms, const EdgeScale& sigma);
/// InvalidInput for a share with a narrower halo.
void check_halo(const stencil::Share* share, int needed);

/// One or two fields u = X, u_t = −Σ_q L_{d_q} L^q u + β (target − u). With one field the target is X; with
/// two, each is drawn to the other.
class DiffusionSolver {
 public:
    struct Field {
        std::vector<DiffusionTerm> terms;
        double coupling = 0;  ///< β
    };
    /// Takes X from the grid, which has leaves only (voxelized). The grid is read now and by `removed`, and
    /// has to live as long. InvalidInput for values that are not finite. `share`: the grid is one member's
    /// part of a larger one, ghosts included; it has to live as long. Its halo is at least diffusion_halo.
    /// What is told of the grid, here and in reports, is of all parts.
    DiffusionSolver(const openvdb::FloatGrid& grid, std::vector<Field> fields, const EdgeScale& sigma,
                    const stencil::Share* share = nullptr);

    /// Explicit steps are stable up to this.
    double bound() const;
    /// The step to use: dt, or 0.9 of the largest allowed, which is the bound, and 20 times it for ADI (see
    /// implicit_step). InvalidInput for a dt above that.
    double step(Stepper stepper, const std::optional<double>& dt) const;
    /// Evaluates the coefficients and takes n steps: FSI's, n times α = 1, or n semi-implicit ones. Checks
    /// that the values are finite and that their mean stays where it was; NumericalError.
    void cycle(Stepper stepper, int n, double tau, const Progress& progress = {});
    /// Takes the cycles and adds them to the report's steps, time, cycles; its dt becomes τ.
    void run(Stepper stepper, const std::vector<CycleRun>& cycles, HyperdiffusionReport& report,
             const Progress& progress = {});
    /// Voxels, means, what was removed, memory.
    void describe(HyperdiffusionReport& report) const;

    std::uint64_t active_voxels() const { return active_; }
    double mean_before() const { return mean_before_; }
    double mean(std::size_t field = 0) const { return summary_[field].mean() + offset_; }
    bool constant_coefficients() const { return sigma_.kind == EdgeScale::Kind::infinite; }
    /// Back to u = X.
    void reset();
    /// Root mean square of X − u over the active voxels, of the first field.
    double removed() const;
    /// Writes the first field into the grid's active voxels; with two fields their difference.
    void store(openvdb::FloatGrid& grid) const;
    /// Bytes sent to other members.
    std::uint64_t bytes_sent() const { return ghosts_ ? ghosts_->bytes_sent() : 0; }
    /// Memory of fields and tables.
    std::size_t state_bytes() const;

 private:
    struct State {
        stencil::ShiftedField now, before;
        std::vector<stencil::BlockField> diffusivities;  // by term; empty with constant coefficients
    };
    void run(Stepper stepper, const CycleRun& cycles, HyperdiffusionReport& report, const Progress& progress);
    void implicit_step(double tau);
    void freeze();
    void freeze(std::size_t field);
    stencil::SweepPlan plan();
    void take_sweep(stencil::SweepPlan& plan, const Progress& progress);
    std::vector<float*> states(bool before);
    Team* team() const { return share_ ? share_->team : nullptr; }
    void check();

    const openvdb::FloatGrid& grid_;
    const stencil::Share* share_;
    stencil::BlockLayout layout_;
    std::unique_ptr<stencil::GhostExchange> ghosts_;  // of a share
    std::vector<Field> fields_;
    std::vector<State> states_;
    stencil::BlockField input_;  // X, where it is a target
    std::vector<stencil::FieldSummary> summary_;
    EdgeScale sigma_;
    Vec3d weights_;
    float offset_ =
        0;  // taken off X, so that rounding errors go with the spread of the values, not their size
    double mean_before_ = 0, range_ = 0;
    std::uint64_t active_ = 0;
};

}  // namespace vdbgeo
