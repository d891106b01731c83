#include "vdbgeo/flow/level_set_flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/flow/level_set_operators.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using stencil::BlockField;

/// Explicit steps of mean curvature are stable up to 2 over the largest rate of −Δ, 12 / voxel².
constexpr double explicit_bound = 1.0 / 6;

double env(const char* n, double d) { const char* s = getenv(n); return s ? atof(s) : d; }

#include <chrono>
struct Clock { std::chrono::steady_clock::time_point t=std::chrono::steady_clock::now(); double lap(){auto n=std::chrono::steady_clock::now(); double d=std::chrono::duration<double>(n-t).count(); t=n; return d;} };
double t_speed=0,t_cg=0,t_re=0;
class Stepper {
 public:
    Stepper(SurfaceBand& band, const LevelSetFlowOptions& options) : band_(band), options_(options) {}

    /// One step, of at most `left`. Returns the time it takes.
    double step(double left) {
        return options_.flow == SurfaceFlow::mean_curvature ? explicit_step(left) : implicit_step(left);
    }

    double moved() const { return moved_; }
    void rebuilt() { moved_ = 0; }
    int its = 0; double vmax = 0;

 private:
    double explicit_step(double left) {
        const double dt = std::min(left, options_.dt.value_or(0.9 * explicit_bound));
        const BlockField rate = mean_curvature_rate(band_);
        move(rate, static_cast<float>(dt));
        return dt;
    }

    double implicit_step(double left) {
        const bool willmore = options_.flow == SurfaceFlow::willmore;
        Clock clk;
        BlockField speed = willmore ? willmore_speed(band_) : surface_diffusion_speed(band_);
        const double fastest = largest(speed);
        vmax = fastest;
        const double stiffness = willmore ? 0.5 : 1;
        double dt = options_.dt.value_or(std::min(env("CAP", 100), env("MOVE", 0.1) / std::max(fastest, 1e-12)));
        dt = std::min(dt, left);
        t_speed+=clk.lap();
        BlockField delta;
        its = solve_biharmonic(band_.layout(), env("S", 1) * stiffness * dt, speed, env("TOL", 1e-3), env("ABS",1e-5)/dt, delta);
        t_cg+=clk.lap();
        move(delta, static_cast<float>(-dt));
        return dt;
    }

    void move(const BlockField& rate, float factor) {
        const double most = largest(rate) * std::abs(factor);
        if (!(most <= 1)) throw NumericalError(fmt::format("the surface moved {} voxels in a step", most));
        const float* r = rate.brick(0);
        float* phi = band_.phi();
        parallel_for(rate.bricks() * BlockField::brick_size, 1 << 14, [=](std::size_t i) { phi[i] += factor * r[i]; });
        moved_ += most;
    }

    SurfaceBand& band_;
    const LevelSetFlowOptions& options_;
    double moved_ = 0;
};

}  // namespace

void LevelSetFlowOptions::check() const {
}

LevelSetFlowReport level_set_flow(FloatGrid& grid, const LevelSetFlowOptions& options, const Progress& progress) {
    options.check();
    LevelSetFlowReport report;
    SurfaceBand band(grid, std::max(options.half_width, SurfaceBand::min_half_width));
    report.volume_before = report.volume_after = band.measures().volume;
    Stepper stepper(band, options);
    int since = 0;
    while (!band.vanished() && options.time - report.time > 1e-9 * options.time) {
        const double dt = stepper.step(options.time - report.time);
        report.time += dt;
        report.dt = std::max(report.dt, dt);
        ++report.steps;
        if (getenv("V") && report.steps % atoi(getenv("V")) == 0) {
            auto m = band.measures();
            fmt::print("t {} dt {} vmax {} its {} vol {} area {} active {}\n", report.time, dt, stepper.vmax, stepper.its, m.volume, m.area, band.layout().active_count());
        }
        if (++since >= env("EVERY", options.flow == SurfaceFlow::mean_curvature ? 5 : 1)) {
            Clock c; band.rebuild(), stepper.rebuilt(); t_re+=c.lap();
            since = 0;
        }
        progress.report(report.time / options.time);
    }
    if (since) band.rebuild();
    if(getenv("V")) fmt::print("speed {} cg {} rebuild {}\n",t_speed,t_cg,t_re);
    report.vanished = band.vanished();
    report.volume_after = band.measures().volume;
    band.write(grid);
    report.active_voxels = grid.activeVoxelCount();
    return report;
}

}  // namespace vdbgeo
