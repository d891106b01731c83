#include "vdbgeo/flow/cycles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

double fsi_relaxation(int k) { return (4.0 * k + 2) / (2.0 * k + 3); }

double cycle_time(Stepper stepper, int n, double tau) {
    return stepper == Stepper::fsi ? tau * n * (n + 1) / 3 : tau * n;
}

int growing_cycle(int order, int k) {
    constexpr double smoothed = 1.73, lambda = 12, most = 300;
    const double n = smoothed * std::pow(lambda, 0.5 * (order + 1)) * std::pow(order == 0 ? 1.25 : 2.0, k);
    return static_cast<int>(std::min(n + 0.5, most));
}

namespace {

constexpr double whole = 1 - 1e-12;  // a time of just so many steps takes no further one

/// As many cycles of one length, as short as that leaves it.
CycleRun equal_cycles(Stepper stepper, int cycles, double time, double largest) {
    CycleRun r{cycles, 1, 0};
    const double share = time / cycles;
    while (cycle_time(stepper, r.n, largest) < share * whole && stepper == Stepper::fsi) ++r.n;
    r.tau = share / cycle_time(stepper, r.n, 1);
    return r;
}

}  // namespace

std::vector<CycleRun> cycles_for_time(Stepper stepper, double time, double largest, const CycleRule& rule) {
    if (time <= 0) return {};
    if (stepper != Stepper::fsi || rule.longest) {
        const int n = stepper == Stepper::fsi ? *rule.longest : 1;
        const double cycles = std::ceil(time / cycle_time(stepper, n, largest) * whole);
        if (cycles > 1e9)
            throw InvalidInput(
                fmt::format("time {:g} takes {:.3g} cycles of steps of {:g}", time, cycles, largest));
        const int least = stepper == Stepper::fsi ? rule.least : 1;
        return {equal_cycles(stepper, std::max(least, static_cast<int>(cycles)), time, largest)};
    }
    std::vector<CycleRun> growing;
    double all = 0;
    while (all < time * whole || static_cast<int>(growing.size()) < rule.least) {
        growing.push_back({1, growing_cycle(rule.order, static_cast<int>(growing.size())), 0});
        all += cycle_time(stepper, growing.back().n, largest);
        if (growing.size() > 1000000)
            throw InvalidInput(
                fmt::format("time {:g} takes more than a million cycles of steps of {:g}", time, largest));
    }
    if (static_cast<int>(growing.size()) <= rule.least)
        return {equal_cycles(stepper, rule.least, time, largest)};
    for (CycleRun& r : growing) r.tau = largest * (time / all);
    return growing;
}

namespace {

void take(CycleSolver& solver, Stepper stepper, const CycleRun& cycles, HyperdiffusionReport& report,
          const Progress& progress) {
    // With constant coefficients Euler's steps need no cycles: many go into one pass.
    const int most = stepper == Stepper::euler && solver.constant_coefficients() ? 64 : 1;
    for (int done = 0; done < cycles.cycles;) {
        const int together = std::min(most, cycles.cycles - done);
        solver.cycle(stepper, cycles.n * together, cycles.tau,
                     progress.part(double(done) / cycles.cycles, double(done + together) / cycles.cycles));
        done += together;
    }
    report.steps += cycles.cycles * cycles.n;
    report.cycles += cycles.cycles;
    report.time += cycles.cycles * cycle_time(stepper, cycles.n, cycles.tau);
    report.dt = cycles.tau;
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
    UntilNoiseIsGone(CycleSolver& solver, const HyperdiffusionOptions& o, double largest, double noise)
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

    CycleSolver& solver_;
    const HyperdiffusionOptions& options_;
    double largest_, noise_;
    int most_steps_;
    std::vector<CycleRun> cycles_;
};

}  // namespace

void CycleSolver::run(Stepper stepper, const std::vector<CycleRun>& cycles, HyperdiffusionReport& report,
                      const Progress& progress) {
    double all = 0, done = 0;
    for (const CycleRun& r : cycles) all += double(r.cycles) * r.n;
    for (const CycleRun& r : cycles) {
        const double share = double(r.cycles) * r.n;
        take(*this, stepper, r, report, progress.part(done / all, (done + share) / all));
        done += share;
    }
}

void take_cycles(CycleSolver& solver, const HyperdiffusionOptions& options, double step, double noise,
                 HyperdiffusionReport& report, const Progress& progress) {
    if (options.time || options.steps)
        solver.run(options.stepper, plan_of(options, step), report, progress);
    else if (noise > 0)
        UntilNoiseIsGone(solver, options, step, noise).run(report, progress);
}

}  // namespace vdbgeo
