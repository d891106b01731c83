#include "vdbgeo/flow/hyperdiffusion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/diffusion_solver.h"
#include "vdbgeo/flow/noise.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {
namespace {

void require(bool holds, const std::string& message) {
    if (!holds) throw InvalidInput(message);
}

int highest_order(const HyperdiffusionOptions& o) {
    int q = 0;
    for (const DiffusionTerm& t : o.terms) q = std::max(q, t.order);
    return q;
}

/// What the options ask for, given the largest step.
std::vector<CycleRun> plan_of(const HyperdiffusionOptions& o, double largest) {
    if (o.time)
        return cycles_for_time(o.stepper, *o.time, largest, {highest_order(o), o.cycle, o.min_cycles});
    if (o.stepper != Stepper::fsi) return {{*o.steps, 1, largest}};
    std::vector<CycleRun> plan;
    const int longest = o.cycle.value_or(20),
              cycles = std::max(o.min_cycles, (*o.steps + longest - 1) / longest);
    for (int c = 0, done = 0; c < cycles; ++c) {
        const int end = static_cast<int>(static_cast<std::int64_t>(*o.steps) * (c + 1) / cycles);
        if (end > done) plan.push_back({1, end - done, largest});
        done = end;
    }
    return plan;
}

/// Takes growing cycles until what was removed reaches the noise (discrepancy principle), or a limit of
/// steps. Where the last cycle went beyond, all is done once more up to the time between.
class UntilNoiseIsGone {
 public:
    UntilNoiseIsGone(DiffusionSolver& solver, const HyperdiffusionOptions& o, double largest, double noise)
        : solver_(solver),
          options_(o),
          largest_(largest),
          noise_(noise),
          most_steps_(solver.active_voxels() > large ? 150 : 320) {}

    void run(HyperdiffusionReport& report, const Progress& progress) {
        int n = next_cycle(0);
        double time = 0, removed = 0;
        for (int k = 0; cycles_.empty() || report.steps + n <= most_steps_; ++k) {
            take({1, n, largest_}, report, progress);
            const double now = solver_.removed();
            // The first cycle turns the finest noise over a little: that it removes more than there is says
            // nothing.
            if (now >= noise_ * (k == 0 ? 1 + turned : 1)) {
                if (removed > noise_)  // the first cycle had been too long after all
                    go_back(0, 0, time, removed, report, progress);
                else if (now > (1 + tolerance) * noise_)
                    go_back(time, removed, report.time, now, report, progress);
                return;
            }
            time = report.time;
            removed = now;
            n = next_cycle(k + 1);
        }
    }

 private:
    /// Beyond this many voxels patience counts more than the last tenth of a dB.
    static constexpr std::uint64_t large = 64000000;
    static constexpr double tolerance = 0.01, turned = 0.1;

    int next_cycle(int k) const {
        const int n = growing_cycle(highest_order(options_), k);
        return options_.cycle ? std::min(*options_.cycle, n) : n;
    }
    void take(const CycleRun& cycle, HyperdiffusionReport& report, const Progress& progress) {
        cycles_.push_back(cycle);
        solver_.run(Stepper::fsi, std::vector<CycleRun>{cycle}, report,
                    progress.part(std::min(1.0, report.steps / double(most_steps_)),
                                  std::min(1.0, (report.steps + cycle.n) / double(most_steps_))));
    }

    /// Once more, to where `noise_` is removed, given what was by two times: that goes about with the
    /// logarithm of the time; from nothing on, with its square root.
    void go_back(double time, double removed, double later, double removed_later,
                 HyperdiffusionReport& report, const Progress& progress) {
        const double share = (noise_ - removed) / (removed_later - removed);
        const double until = time > 0 ? time * std::pow(later / time, share) : later * share * share;
        std::vector<CycleRun> again;
        double all = 0;
        for (const CycleRun& c : cycles_) {
            const double more = cycle_time(Stepper::fsi, c.n, c.tau);
            if (all + more > time * (1 + 1e-9)) break;
            all += more;
            again.push_back(c);
        }
        const int least = again.empty() ? options_.min_cycles : 1;
        const CycleRule rule{highest_order(options_), options_.cycle.value_or(300), least};
        for (const CycleRun& c : cycles_for_time(Stepper::fsi, until - all, largest_, rule))
            again.push_back(c);
        report.steps = report.cycles = 0;
        report.time = 0;
        solver_.reset();
        solver_.run(Stepper::fsi, again, report, progress);
    }

    DiffusionSolver& solver_;
    const HyperdiffusionOptions& options_;
    double largest_, noise_;
    int most_steps_;
    std::vector<CycleRun> cycles_;
};

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
                                  const Progress& progress, const stencil::Share* share) {
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
    if (!report.automatic)
        solver.run(options.stepper, plan_of(options, step), report, progress);
    else if (report.noise > 0)
        UntilNoiseIsGone(solver, options, step, report.noise).run(report, progress);
    solver.describe(report);
    if (report.steps) solver.store(grid);
    return report;
}

}  // namespace vdbgeo
