#include "vdbgeo/flow/diffusion_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/state_file.h"
#include "vdbgeo/stencil/diffusivity.h"

namespace vdbgeo {

using stencil::BlockLayout;
using stencil::FieldSummary;

int diffusion_halo(const std::vector<DiffusionTerm>& terms, const EdgeScale& sigma) {
    int halo = sigma.kind == EdgeScale::Kind::local ? sigma.radius + 1 : 1;
    for (const DiffusionTerm& t : terms) halo = std::max(halo, stencil::sweep_halo(t.order));
    return (halo + 7) / 8 * 8;
}

void check_halo(const stencil::Share* share, int needed) {
    if (share && share->halo < needed)
        throw InvalidInput(
            fmt::format("a halo of {} voxels is needed, and there is one of {}", needed, share->halo));
}

void check_finite(const FieldSummary& given) {
    if (given.non_finite)
        throw InvalidInput(
            fmt::format("{} of {} values are NaN or infinite; --threshold or --mask leaves them out",
                        given.non_finite, given.count + given.non_finite));
}

void check_diverged(const std::vector<FieldSummary>& now, const FieldSummary& before, float offset) {
    constexpr double drift_limit = 1e-3;  // of the range of X: rounding stays orders of magnitude below it
    for (const FieldSummary& s : now)
        if (s.non_finite)
            throw NumericalError("the values diverged: a smaller --dt or --diffusivity is needed");
    const double range = static_cast<double>(before.max) - before.min;
    if (now.size() == 1 && std::abs(now[0].mean() - before.mean()) > drift_limit * std::max(range, 1e-300))
        throw NumericalError(fmt::format("the mean drifted from {:.7g} to {:.7g}", before.mean() + offset,
                                         now[0].mean() + offset));
}

DiffusionSolver::DiffusionSolver(const openvdb::FloatGrid& grid, std::vector<DiffusionProblem::Field> fields,
                                 const EdgeScale& sigma, const stencil::Share* share)
    : grid_(grid),
      share_(share),
      problem_(std::move(fields), sigma, axis_weights(grid.transform())),
      fields_(problem_, BlockLayout(grid.tree(), share ? std::optional(share->own()) : std::nullopt)) {
    const BlockLayout& layout = fields_.layout();
    if (share) ghosts_ = std::make_unique<stencil::GhostExchange>(layout, *share);
    stencil::load(layout, grid.tree(), 0, fields_.now());
    const FieldSummary given = stencil::summarize(layout, fields_.now(), team());
    check_finite(given);
    measure_.range = static_cast<double>(given.max) - given.min;
    offset_ = static_cast<float>(given.mean());
    fields_.load(grid.tree(), offset_);
    before_ = stencil::summarize(layout, fields_.now(), team());
    summary_.assign(problem_.fields.size(), before_);
}

double DiffusionSolver::step(Stepper stepper, const std::optional<double>& dt) const {
    if (team() && stepper == Stepper::adi)
        throw InvalidInput("the stepper adi solves along whole lines of the map: parts of it will not do");
    return problem_.step(stepper, dt);
}

/// Coefficients of all fields, those of ghosts too: they come from their owners.
void DiffusionSolver::freeze() {
    if (constant_coefficients()) return;
    if (problem_.sigma.kind == EdgeScale::Kind::global) {
        measure_.variance.clear();
        for (std::size_t i = 0; i < problem_.fields.size(); ++i) {
            std::vector<double>& of_terms = measure_.variance.emplace_back();
            for (const DiffusionTerm& t : problem_.fields[i].terms)
                of_terms.push_back(t.order > 0 ? gradient_variance(fields_.layout(), fields_.now(i),
                                                                   problem_.weights, team())
                                               : summary_[i].variance());
        }
    }
    fields_.freeze(measure_);
    if (ghosts_) ghosts_->run(fields_.coefficients());
}

/// A sweep, and what other members need of it on its way while it goes on.
void DiffusionSolver::take_sweep(stencil::SweepPlan& plan, const Progress& progress) {
    const BlockLayout& layout = fields_.layout();
    if (!ghosts_) return sweep(layout, plan, progress);
    const std::vector<float*> read = fields_.states(!plan.begins);
    const std::vector<const float*> written = fields_.next_states(!plan.ends);
    ghosts_->begin(written.size());
    plan.before_slab = [&](std::size_t slab) { ghosts_->fill_around(slab, read); };
    plan.after_slab = [&](std::size_t slab) { ghosts_->send(slab, written); };
    plan.meanwhile = [&] { ghosts_->move(); };
    sweep(layout, plan, progress);
}

void DiffusionSolver::cycle(Stepper stepper, int n, double tau, const Progress& progress) {
    freeze();
    if (stepper == Stepper::adi) {
        for (int k = 0; k < n; ++k) {
            fields_.implicit_step(tau);
            progress.report(double(k + 1) / n);
        }
    } else {
        const auto sweeps = sweeps_of_cycle(stepper, n, tau, problem_.highest_order());
        const auto count = static_cast<double>(sweeps.size());
        for (std::size_t s = 0; s < sweeps.size(); ++s) {
            stencil::SweepPlan plan = fields_.plan(sweeps[s]);
            take_sweep(plan, progress.part(double(s) / count, double(s + 1) / count));
        }
    }
    summarize();
    check_diverged(summary_, before_, offset_);
    if (ghosts_) ghosts_->fill_all(fields_.states(false));
}

void DiffusionSolver::summarize() {
    for (std::size_t i = 0; i < summary_.size(); ++i)
        summary_[i] = stencil::summarize(fields_.layout(), fields_.now(i), team());
}

void DiffusionSolver::describe(HyperdiffusionReport& report) {
    report.active_voxels = active_voxels();
    report.mean_before = before_.mean() + offset_;
    report.mean_after = summary_[0].mean() + offset_;
    report.state_bytes = fields_.memory();
    report.bytes_sent = ghosts_ ? ghosts_->bytes_sent() : 0;
    report.removed = removed();
}

void DiffusionSolver::reset() {
    fields_.load(grid_.tree(), offset_);
    summarize();
}

std::uint64_t DiffusionSolver::input_hash() {
    const BlockLayout& layout = fields_.layout();
    stencil::BlockField x(layout.brick_count());
    stencil::load(layout, grid_.tree(), offset_, x.brick(0));
    std::vector<std::uint64_t> hash{stencil::hash_of_bricks(layout, x.brick(0))};
    if (team()) team()->add_up(hash);
    return hash[0];
}

void DiffusionSolver::save(StateWriter& writer) {
    const std::vector<float*> now = fields_.states(false);
    writer.add(fields_.layout(), {now.begin(), now.end()});
}

void DiffusionSolver::load(const StateReader& reader) {
    reader.read(fields_.layout(), fields_.states(false));
    summarize();
}

double DiffusionSolver::removed() {
    ExactSum squares = squared_change(fields_.layout(), grid_.tree(), offset_, fields_.now());
    if (team()) squares.add_up(*team());
    return root_mean_square(squares, active_voxels());
}

}  // namespace vdbgeo
