#include "vdbgeo/flow/level_set_flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/flow/level_set_operators.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using stencil::BlockField;

/// Explicit steps of mean curvature are stable up to 2 over the largest rate of −Δ, 12 / voxel².
constexpr double explicit_bound = 2.0 / 12;
constexpr int explicit_steps = 5;  // between two rebuilds of the band

// Implicit steps.
constexpr double step_length = 0.1;  // voxels that the surface moves in a step
constexpr double shortest_step = 0.25, longest_step = 256;
/// Speeds above are cut: radii of a voxel or less, which the lattice does not show.
constexpr double fastest = step_length / shortest_step;
/// Splitting constant S over the coefficient of Δ_s². At ½ (Smereka 2003) ripples of two voxels grow slowly,
/// as on the lattice their discrete Δ² is less than what the interpolated speed answers.
constexpr double splitting = 1;
constexpr double solve_relative = 1e-2, solve_absolute = 1e-5;  // of the movement; voxels

class Steps {
 public:
    Steps(SurfaceBand& band, const LevelSetFlowOptions& options)
        : band_(band), options_(options), volume_(band.measures().volume) {}

    /// One step, of at most `left`. Returns the time it takes.
    double step(double left) {
        if (options_.flow == SurfaceFlow::mean_curvature) return explicit_step(left);
        return implicit_step(left);
    }

    void finish() {
        if (since_rebuild_ > 0) rebuild();
    }

 private:
    double explicit_step(double left) {
        const double dt = std::min(left, options_.dt.value_or(0.9 * explicit_bound));
        move(mean_curvature_rate(band_), dt);
        if (++since_rebuild_ == explicit_steps) rebuild();
        return dt;
    }

    double implicit_step(double left) {
        const bool willmore = options_.flow == SurfaceFlow::willmore;
        BlockField speed = willmore ? willmore_speed(band_) : surface_diffusion_speed(band_);
        cut(speed);
        const double unset =
            std::clamp(step_length / std::max(largest(speed), 1e-30), shortest_step, longest_step);
        const double dt = std::min(left, options_.dt.value_or(unset));
        const double stiffness = willmore ? 0.5 : 1;
        BlockField change;  // of −φ, per time
        solve_biharmonic(band_.layout(), splitting * stiffness * dt, speed, solve_relative,
                         solve_absolute / dt, change);
        const double most = largest(change) * dt;
        if (!(most <= 1))
            throw NumericalError(fmt::format(
                "the surface moves {:.3g} voxels in one step of {:.6g}; take a smaller one", most, dt));
        move(change, -dt);
        ++since_rebuild_;
        rebuild();
        if (options_.flow == SurfaceFlow::surface_diffusion) restore_volume();
        return dt;
    }

    void cut(BlockField& speed) const {
        float* v = speed.brick(0);
        const auto most = static_cast<float>(fastest);
        parallel_for(speed.bricks() * BlockField::brick_size, 1 << 14,
                     [=](std::size_t i) { v[i] = std::clamp(v[i], -most, most); });
    }

    void move(const BlockField& rate, double dt) {
        if (!std::isfinite(largest(rate))) throw NumericalError("the level set's speed is not finite");
        const float* r = rate.brick(0);
        float* phi = band_.phi();
        const auto factor = static_cast<float>(dt);
        parallel_for(rate.bricks() * BlockField::brick_size, 1 << 14,
                     [=](std::size_t i) { phi[i] += factor * r[i]; });
    }

    void rebuild() {
        band_.rebuild();
        since_rebuild_ = 0;
    }

    /// Moves the surface everywhere by as much as its volume asks for.
    void restore_volume() {
        const SurfaceBand::Measures now = band_.measures();
        if (band_.vanished() || !(now.area > 0)) return;
        const double shift = std::clamp((now.volume - volume_) / now.area, -step_length, step_length);
        const stencil::BlockLayout& layout = band_.layout();
        float* phi = band_.phi();
        parallel_for(layout.brick_count() * BlockField::brick_size, 1 << 14,
                     [=](std::size_t i) { phi[i] += static_cast<float>(shift); });
    }

    SurfaceBand& band_;
    const LevelSetFlowOptions& options_;
    double volume_;
    int since_rebuild_ = 0;
};

void check_level_set(const FloatGrid& grid) {
    if (grid.getGridClass() != openvdb::GRID_LEVEL_SET)
        throw InvalidInput(fmt::format("the grid is of class '{}', not a level set",
                                       openvdb::GridBase::gridClassToString(grid.getGridClass())));
    if (!grid.transform().isLinear() || !grid.hasUniformVoxels())
        throw InvalidInput("the level set's voxels are not cubic");
    if (!(grid.background() > 0)) throw InvalidInput("the level set's background is not positive");
    for (auto it = grid.cbeginValueOn(); it; ++it)
        if (!std::isfinite(*it)) throw InvalidInput("the level set has a value that is not finite");
}

}  // namespace

void LevelSetFlowOptions::check() const {
    if (!(time >= 0) || !std::isfinite(time))
        throw InvalidInput(fmt::format("the time of a flow is {}, not 0 or more", time));
    if (dt && !(*dt > 0 && std::isfinite(*dt)))
        throw InvalidInput(fmt::format("the step of a flow is {}, not above 0", *dt));
    if (dt && flow == SurfaceFlow::mean_curvature && *dt > explicit_bound)
        throw InvalidInput(fmt::format(
            "the step {} is above the bound of mean curvature flow, {:.6g} voxel^2", *dt, explicit_bound));
    if (half_width != 0 && (half_width < 2 || half_width > SurfaceBand::max_half_width))
        throw InvalidInput(fmt::format("half the width of the band is {} voxels, not 2 to {}, or 0",
                                       half_width, SurfaceBand::max_half_width));
}

LevelSetFlowReport level_set_flow(FloatGrid& grid, const LevelSetFlowOptions& options,
                                  const Progress& progress) {
    options.check();
    check_level_set(grid);
    LevelSetFlowReport report;
    if (grid.activeVoxelCount() == 0) {
        report.vanished = true;
        return report;
    }
    const int given = static_cast<int>(std::ceil(grid.background() / grid.voxelSize()[0]));
    const int out =
        std::min(options.half_width > 0 ? options.half_width : given, SurfaceBand::max_half_width);
    SurfaceBand band(
        grid, std::max({out, std::min(given, SurfaceBand::max_half_width), SurfaceBand::min_half_width}),
        progress.part(0, 0));
    report.volume_before = report.volume_after = band.measures().volume;
    report.active_voxels = grid.activeVoxelCount();
    report.vanished = band.vanished();
    if (options.time == 0) return report;

    Steps steps(band, options);
    const double rounding = 1e-9 * options.time;
    while (!band.vanished() && options.time - report.time > rounding) {
        const double done = report.time / options.time;
        band.watch(progress.part(done, done));
        const double dt = steps.step(options.time - report.time);
        report.time += dt;
        report.dt = std::max(report.dt, dt);
        ++report.steps;
        progress.report(report.time / options.time);
    }
    steps.finish();
    report.vanished = band.vanished();
    report.volume_after = band.measures().volume;
    band.write(grid, options.half_width > 0 || given > out ? out * grid.voxelSize()[0] : grid.background());
    report.active_voxels = grid.activeVoxelCount();
    progress.report(1);
    return report;
}

}  // namespace vdbgeo
