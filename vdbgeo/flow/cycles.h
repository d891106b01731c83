// Diffusion in cycles of frozen coefficients: how a time is divided into them, and who takes them.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo {

class StateReader;
class StateWriter;

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

/// What takes the cycles, wherever the fields are.
class CycleSolver {
 public:
    virtual ~CycleSolver() = default;

    /// Many of Euler's steps may be taken as one cycle.
    virtual bool constant_coefficients() const = 0;
    virtual std::uint64_t active_voxels() const = 0;
    /// Evaluates the coefficients and takes n steps: FSI's, n times α = 1, or n semi-implicit ones. Checks
    /// that the values are finite and that their mean stays where it was; NumericalError.
    virtual void cycle(Stepper stepper, int n, double tau, const Progress& progress) = 0;
    /// Back to u = X.
    virtual void reset() = 0;
    /// Root mean square of X − u over the active voxels, of the first field.
    virtual double removed() = 0;

    /// A number that tells X from other maps; of all members.
    virtual std::uint64_t input_hash() = 0;
    /// How many fields there are; between cycles they are all there is to know.
    virtual std::size_t fields() const = 0;
    virtual void save(StateWriter& writer) = 0;
    virtual void load(const StateReader& reader) = 0;

    /// Takes the cycles and adds them to the report's steps, time, cycles; its dt becomes τ.
    void run(Stepper stepper, const std::vector<CycleRun>& cycles, HyperdiffusionReport& report,
             const Progress& progress = {});
};

/// Takes the cycles that the options ask for, with steps of `step`: those of a time, a number of steps, or
/// until `noise` is removed (HyperdiffusionOptions::time).
void take_cycles(CycleSolver& solver, const HyperdiffusionOptions& options, double step, double noise,
                 HyperdiffusionReport& report, const Progress& progress);

}  // namespace vdbgeo
