#include "vdbgeo/flow/geometric_flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/flow/diffusion_solver.h"
#include "vdbgeo/flow/flow_steps.h"
#include "vdbgeo/flow/geometric_rate.h"
#include "vdbgeo/stencil/ghost_exchange.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using stencil::BlockField;
using stencil::BlockLayout;

constexpr int max_order = 7;

/// All of a map in memory, or a member's part.
class Flow : public FlowSteps {
 public:
    Flow(const BlockLayout& layout, const openvdb::FloatTree& tree, const Vec3d& weights,
         const GeometricFlowOptions& options, const stencil::Share* share)
        : layout_(layout),
          rate_of_(options, weights),
          share_(share),
          state_(layout.brick_count()),
          rate_(layout.brick_count()),
          input_(layout.brick_count()) {
        if (share) ghosts_ = std::make_unique<stencil::GhostExchange>(layout, *share);
        stencil::load(layout, tree, 0, input_.brick(0));
        const std::size_t values = layout.brick_count() * BlockField::brick_size;
        std::copy_n(input_.brick(0), values, state_.brick(0));
        std::fill_n(rate_.brick(0), values, 0.0f);  // those of ghosts are never found
    }

    const float* state() const { return state_.brick(0); }
    const float* input() const { return input_.brick(0); }
    std::size_t memory() const {
        return state_.memory() + rate_.memory() + input_.memory() + layout_.memory();
    }
    std::uint64_t bytes_sent() const { return ghosts_ ? ghosts_->bytes_sent() : 0; }

    double bound() override {
        const double mine = rate_of_(layout_, state(), input(), rate_.brick(0));
        double most = mine;
        if (team())
            for (const double other : gather_all(*team(), std::vector<double>{mine}))
                most = std::max(most, other);
        return rate_of_.bound(most);
    }
    stencil::FieldSummary take(double dt) override {
        const auto factor = static_cast<float>(dt);
        float* s = state_.brick(0);
        const float* r = rate_.brick(0);
        parallel_for(layout_.brick_count() * BlockField::brick_size, 1 << 14,
                     [=](std::size_t i) { s[i] += factor * r[i]; });
        if (ghosts_) ghosts_->run({s});
        return stencil::summarize(layout_, state(), team());
    }

 private:
    Team* team() const { return share_ ? share_->team : nullptr; }

    const BlockLayout& layout_;
    GeometricRate rate_of_;
    const stencil::Share* share_;
    std::unique_ptr<stencil::GhostExchange> ghosts_;
    BlockField state_, rate_, input_;
};

}  // namespace

void GeometricFlowOptions::check() const {
    if (order < 0 || order > max_order)
        throw InvalidInput(fmt::format("the order of a geometric flow is {}, not 0 to {}", order, max_order));
    if (!(time >= 0) || !std::isfinite(time))
        throw InvalidInput(fmt::format("the time of a flow is {}, not 0 or more", time));
    if (dt && !(*dt > 0 && std::isfinite(*dt)))
        throw InvalidInput(fmt::format("the step of a flow is {}, not above 0", *dt));
    if (!(fidelity >= 0) || !std::isfinite(fidelity))
        throw InvalidInput(fmt::format("the fidelity of a flow is {}, not 0 or more", fidelity));
    if (!std::isfinite(pressure)) throw InvalidInput("the pressure of a flow is not a finite number");
    if (!(scale > 0) || !std::isfinite(scale))
        throw InvalidInput(fmt::format("the scale of a flow is {}, not above 0", scale));
}

int geometric_flow_halo(const GeometricFlowOptions& options) { return (options.order + 8) / 8 * 8; }

void take_flow_steps(FlowSteps& flow, const stencil::FieldSummary& before,
                     const GeometricFlowOptions& options, HyperdiffusionReport& report,
                     const Progress& progress) {
    constexpr double safety = 0.9;
    report.mean_before = report.mean_after = before.mean();
    const double range = std::max(static_cast<double>(before.max) - before.min, 1e-30);
    while (options.time - report.time > 1e-9 * options.time) {
        const double bound = flow.bound();
        if (options.dt && *options.dt > bound)
            throw InvalidInput(fmt::format("the step {} is above the bound of the geometric flow, {:.6g}",
                                           *options.dt, bound));
        const double dt = std::min(options.time - report.time, options.dt.value_or(safety * bound));
        const stencil::FieldSummary now = flow.take(dt);
        report.time += dt;
        report.dt = std::max(report.dt, dt);
        ++report.steps;
        const bool grew = options.pressure == 0 && static_cast<double>(now.max) - now.min > 1e3 * range;
        if (now.non_finite > 0 || grew)
            throw NumericalError(fmt::format("the geometric flow diverged at time {:.6g}", report.time));
        report.mean_after = now.mean();
        progress.report(report.time / options.time);
    }
}

HyperdiffusionReport geometric_flow(FloatGrid& grid, const GeometricFlowOptions& options,
                                    const Progress& progress, const stencil::Share* share) {
    options.check();
    check_halo(share, geometric_flow_halo(options));
    HyperdiffusionReport report;
    if (!share && grid.activeVoxelCount() == 0) return report;
    Team* const team = share ? share->team : nullptr;
    const auto tree = std::make_shared<openvdb::FloatTree>(grid.tree());
    tree->voxelizeActiveTiles();
    const BlockLayout layout(*tree, share ? std::optional(share->own()) : std::nullopt);
    Flow flow(layout, *tree, axis_weights(grid.transform()), options, share);
    report.state_bytes = flow.memory();
    const stencil::FieldSummary before = stencil::summarize(layout, flow.input(), team);
    report.active_voxels = before.count + before.non_finite;
    if (report.active_voxels == 0) return report;
    if (before.non_finite > 0)
        throw InvalidInput(fmt::format("{} values of the grid are not finite", before.non_finite));
    take_flow_steps(flow, before, options, report, progress);
    if (report.steps == 0) return report;
    report.removed = std::sqrt(stencil::squared_distance(layout, flow.input(), flow.state(), team) /
                               static_cast<double>(report.active_voxels));
    report.bytes_sent = flow.bytes_sent();
    stencil::store(layout, flow.state(), 0, *tree);
    grid.setTree(tree);
    progress.report(1);
    return report;
}

}  // namespace vdbgeo
