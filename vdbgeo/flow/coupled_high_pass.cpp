#include "vdbgeo/flow/coupled_high_pass.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/checkpoint.h"
#include "vdbgeo/flow/diffusion_solver.h"

namespace vdbgeo {
namespace {

void require(bool holds, const char* message) {
    if (!holds) throw InvalidInput(message);
}

}  // namespace

void HighPassOptions::check() const {
    require(order >= 0 && order <= 15, "the order is 0 to 15");
    require(std::isfinite(slow) && slow >= 0, "the slow diffusivity is a number, 0 or more");
    require(std::isfinite(fast) && fast >= slow, "the fast diffusivity is at least the slow one");
    require(std::isfinite(coupling_u) && coupling_u >= 0 && std::isfinite(coupling_v) && coupling_v >= 0,
            "couplings are numbers, 0 or more");
    sigma.check();
    require(std::isfinite(time) && time >= 0, "the time is a number, 0 or more");
    require(!dt || (std::isfinite(*dt) && *dt > 0), "dt is a number above 0");
    require(!cycle || (*cycle >= 1 && *cycle <= 300), "a cycle has 1 to 300 steps");
}

std::string HighPassOptions::text() const {
    std::string out = fmt::format(
        "high pass order {} {:a} {:a} coupling {:a} {:a} sigma {} {:a} {:a} {} time {:a} stepper {}", order,
        slow, fast, coupling_u, coupling_v, static_cast<int>(sigma.kind), sigma.value, sigma.factor,
        sigma.radius, time, static_cast<int>(stepper));
    if (dt) out += fmt::format(" dt {:a}", *dt);
    if (cycle) out += fmt::format(" cycle {}", *cycle);
    return out;
}

int high_pass_halo(const HighPassOptions& options) {
    return diffusion_halo({{options.order, options.slow}}, options.sigma);
}

std::vector<DiffusionProblem::Field> high_pass_fields(const HighPassOptions& options) {
    return {{{{options.order, options.slow}}, options.coupling_u},
            {{{options.order, options.fast}}, options.coupling_v}};
}

void take_high_pass_cycles(CycleSolver& solver, const HighPassOptions& options, double step,
                           HyperdiffusionReport& report, const Progress& progress) {
    solver.run(options.stepper,
               cycles_for_time(options.stepper, options.time, step, {options.order, options.cycle, 3}),
               report, progress);
}

HyperdiffusionReport coupled_high_pass(openvdb::FloatGrid& grid, const HighPassOptions& options,
                                       const Progress& progress, const stencil::Share* share,
                                       const CheckpointOptions& checkpoint) {
    options.check();
    check_halo(share, high_pass_halo(options));
    HyperdiffusionReport report;
    if (grid.tree().hasActiveTiles()) grid.tree().voxelizeActiveTiles();
    if (!share && grid.activeVoxelCount() == 0) return report;
    DiffusionSolver solver(grid, high_pass_fields(options), options.sigma, share);
    if (solver.active_voxels() == 0) return report;
    const double step = solver.step(options.stepper, options.dt);
    report.resumed_cycles =
        with_checkpoints(solver, checkpoint, options.text(), share ? share->team : nullptr,
                         [&](CycleSolver& s) { take_high_pass_cycles(s, options, step, report, progress); });
    solver.describe(report);
    solver.store(grid);
    return report;
}

}  // namespace vdbgeo
