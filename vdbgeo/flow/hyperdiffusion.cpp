#include "vdbgeo/flow/hyperdiffusion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/checkpoint.h"
#include "vdbgeo/flow/cycles.h"
#include "vdbgeo/flow/diffusion_solver.h"
#include "vdbgeo/flow/noise.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {
namespace {

void require(bool holds, const std::string& message) {
    if (!holds) throw InvalidInput(message);
}

}  // namespace

EdgeScale EdgeScale::parse(const std::string& text) {
    EdgeScale s;
    if (text == "global") {
        s.kind = Kind::global;
    } else if (text == "inf") {
        s.kind = Kind::infinite;
    } else if (text.rfind("local", 0) == 0) {
        char* end = nullptr;
        if (text.size() > 5) {
            const long r = text[5] == ':' ? std::strtol(text.c_str() + 6, &end, 10) : 0;
            const bool good = end && end != text.c_str() + 6 && !*end && r >= 1 && r <= 8;
            s.radius = good ? static_cast<int>(r) : 0;
        }
        require(s.radius > 0, text + ": the radius of a local sigma is a whole number from 1 to 8 (local:2)");
    } else {
        char* end = nullptr;
        s.kind = Kind::value;
        s.value = std::strtod(text.c_str(), &end);
        require(end != text.c_str() && !*end && std::isfinite(s.value) && s.value > 0,
                text + ": sigma is local, local:R, global, inf or a number above 0");
    }
    return s;
}

std::string EdgeScale::text() const {
    const std::string times = factor == 1 ? "" : fmt::format(" x {:g}", factor);
    switch (kind) {
        case Kind::local:
            return fmt::format("local:{}", radius) + times;
        case Kind::global:
            return "global" + times;
        case Kind::infinite:
            return "inf";
        default:
            return fmt::format("{:g}", value);
    }
}

void EdgeScale::check() const {
    require(radius >= 1 && radius <= 8, "the radius of a local sigma is 1 to 8");
    require(kind != Kind::value || (std::isfinite(value) && value > 0), "sigma is above 0");
    require(std::isfinite(factor) && factor > 0, "the factor of sigma is above 0");
}

void HyperdiffusionOptions::check() const {
    require(!terms.empty(), "at least one order is needed");
    std::set<int> orders;
    for (const DiffusionTerm& t : terms) {
        require(t.order >= 0 && t.order <= 15, fmt::format("order {}: 0 to 15", t.order));
        require(orders.insert(t.order).second, fmt::format("order {} is given twice", t.order));
        require(std::isfinite(t.diffusivity) && t.diffusivity > 0, "a diffusivity is a number above 0");
    }
    sigma.check();
    require(!time || (std::isfinite(*time) && *time >= 0), "the time is a number, 0 or more");
    require(!steps || *steps >= 0, "the number of steps is 0 or more");
    require(!(time && steps), "give the time or the number of steps, not both");
    require(time || steps || stepper == Stepper::fsi, "an automatic time needs the stepper fsi");
    require(!dt || (std::isfinite(*dt) && *dt > 0), "dt is a number above 0");
    require(!cycle || (*cycle >= 1 && *cycle <= 300), "a cycle has 1 to 300 steps");
    require(min_cycles >= 1 && min_cycles <= 1000000, "the least number of cycles is 1 or more");
    require(std::isfinite(fidelity) && fidelity >= 0, "the fidelity is a number, 0 or more");
}

double HyperdiffusionOptions::largest_rate(const Vec3d& weights) const {
    const double lambda = 4 * weights.sum();
    double rate = fidelity;
    for (const DiffusionTerm& t : terms) rate += t.diffusivity * std::pow(lambda, t.order + 1);
    return rate;
}

std::string HyperdiffusionOptions::text() const {
    std::string out = fmt::format("hyperdiffusion sigma {} {:a} {:a} {}", static_cast<int>(sigma.kind),
                                  sigma.value, sigma.factor, sigma.radius);
    for (const DiffusionTerm& t : terms) out += fmt::format(" term {} {:a}", t.order, t.diffusivity);
    out +=
        fmt::format(" stepper {} cycles {} fidelity {:a}", static_cast<int>(stepper), min_cycles, fidelity);
    if (time) out += fmt::format(" time {:a}", *time);
    if (steps) out += fmt::format(" steps {}", *steps);
    if (dt) out += fmt::format(" dt {:a}", *dt);
    if (cycle) out += fmt::format(" cycle {}", *cycle);
    return out;
}

Vec3d axis_weights(const openvdb::math::Transform& transform) {
    const Vec3d h = frame_of(transform).voxel_size();
    Vec3d w;
    // The cell of a file is rounded to single precision: what differs by less is cubic.
    const double least = h.minCoeff();
    for (int a = 0; a < 3; ++a) w[a] = h[a] < least * (1 + 1e-5) ? 1.0 : (least / h[a]) * (least / h[a]);
    return w;
}

int hyperdiffusion_halo(const HyperdiffusionOptions& options) {
    return diffusion_halo(options.terms, options.sigma);
}

HyperdiffusionReport hyperdiffuse(openvdb::FloatGrid& grid, const HyperdiffusionOptions& options,
                                  const Progress& progress, const stencil::Share* share,
                                  const CheckpointOptions& checkpoint) {
    options.check();
    check_halo(share, hyperdiffusion_halo(options));
    HyperdiffusionReport report;
    if (grid.tree().hasActiveTiles()) grid.tree().voxelizeActiveTiles();
    if (!share && grid.activeVoxelCount() == 0) return report;
    report.automatic = !options.time && !options.steps;
    if (report.automatic) report.noise = removable_noise(grid, share);
    DiffusionSolver solver(grid, {{options.terms, options.fidelity}}, options.sigma, share);
    if (solver.active_voxels() == 0) return report;
    const double step = solver.step(options.stepper, options.dt);
    report.resumed_cycles = with_checkpoints(
        solver, checkpoint, options.text(), share ? share->team : nullptr,
        [&](CycleSolver& s) { take_cycles(s, options, step, report.noise, report, progress); });
    solver.describe(report);
    if (report.steps) solver.store(grid);
    return report;
}

}  // namespace vdbgeo
