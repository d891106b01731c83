// What hyperdiffusion, the coupled high-pass and the PDE transform share: fields in memory that are stepped
// in cycles of frozen coefficients.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "vdbgeo/flow/cycles.h"
#include "vdbgeo/flow/diffusion_fields.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/ghost_exchange.h"

namespace vdbgeo {

/// How far around its own cells, in voxels and whole leaves, a member of a team has to have a grid.
int diffusion_halo(const std::vector<DiffusionTerm>& terms, const EdgeScale& sigma);
/// InvalidInput for a share with a narrower halo.
void check_halo(const stencil::Share* share, int needed);
/// InvalidInput for values of X that are not finite.
void check_finite(const stencil::FieldSummary& given);
/// NumericalError for values that are not finite, and, of a field that is alone, for a mean that is no longer
/// where it was: coupled fields exchange what they hold.
void check_diverged(const std::vector<stencil::FieldSummary>& now, const stencil::FieldSummary& before,
                    float offset);

class DiffusionSolver : public CycleSolver {
 public:
    /// Takes X from the grid, which has leaves only (voxelized). The grid is read now and by `removed`, and
    /// has to live as long. InvalidInput for values that are not finite. `share`: the grid is one member's
    /// part of a larger one, ghosts included; it has to live as long. Its halo is at least diffusion_halo.
    /// What is told of the grid, here and in reports, is of all parts.
    DiffusionSolver(const openvdb::FloatGrid& grid, std::vector<DiffusionProblem::Field> fields,
                    const EdgeScale& sigma, const stencil::Share* share = nullptr);

    double step(Stepper stepper, const std::optional<double>& dt) const;
    bool constant_coefficients() const override { return problem_.constant_coefficients(); }
    std::uint64_t active_voxels() const override { return before_.count; }
    void cycle(Stepper stepper, int n, double tau, const Progress& progress = {}) override;
    void reset() override;
    double removed() override;
    std::uint64_t input_hash() override;
    std::size_t fields() const override { return problem_.fields.size(); }
    void save(StateWriter& writer) override;
    void load(const StateReader& reader) override;
    /// Voxels, means, what was removed, memory.
    void describe(HyperdiffusionReport& report);
    /// Writes the first field into the grid's active voxels; with two fields their difference.
    void store(openvdb::FloatGrid& grid) const { fields_.store(offset_, grid.tree()); }

 private:
    void freeze();
    void take_sweep(stencil::SweepPlan& plan, const Progress& progress);
    void summarize();
    Team* team() const { return share_ ? share_->team : nullptr; }

    const openvdb::FloatGrid& grid_;
    const stencil::Share* share_;
    DiffusionProblem problem_;
    DiffusionFields fields_;
    std::unique_ptr<stencil::GhostExchange> ghosts_;  // of a share
    stencil::FieldSummary before_;                    // of X − offset
    std::vector<stencil::FieldSummary> summary_;      // of the fields now
    EdgeMeasure measure_;
    /// Taken off X, so that rounding errors go with the spread of the values, not their size.
    float offset_ = 0;
};

}  // namespace vdbgeo
