#include "vdbgeo/flow/diffusion_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/cell_sums.h"
#include "vdbgeo/stencil/diffusivity.h"
#include "vdbgeo/stencil/line_solve.h"

namespace vdbgeo {
namespace {

using stencil::BlockField;
using stencil::BlockLayout;

constexpr double drift_limit = 1e-3;  // of the range of X: rounding stays orders of magnitude below it

}  // namespace

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

DiffusionSolver::DiffusionSolver(const openvdb::FloatGrid& grid, std::vector<Field> fields,
                                 const EdgeScale& sigma, const stencil::Share* share)
    : grid_(grid),
      share_(share),
      layout_(grid.tree(), share ? std::optional(share->own()) : std::nullopt),
      fields_(std::move(fields)),
      sigma_(sigma),
      weights_(axis_weights(grid.transform())) {
    for (Field& f : fields_) {
        f.terms.erase(std::remove_if(f.terms.begin(), f.terms.end(),
                                     [](const DiffusionTerm& t) { return t.diffusivity == 0; }),
                      f.terms.end());
        if (f.terms.empty()) f.terms = {{0, 0.0}};  // a field that only follows its target
        std::sort(f.terms.begin(), f.terms.end(),
                  [](const DiffusionTerm& a, const DiffusionTerm& b) { return a.order < b.order; });
        State s{stencil::ShiftedField(layout_), stencil::ShiftedField(layout_), {}};
        if (!constant_coefficients())
            for (const DiffusionTerm& t : f.terms)
                s.diffusivities.push_back(t.diffusivity > 0 ? BlockField(layout_.brick_count())
                                                            : BlockField());
        states_.push_back(std::move(s));
    }
    if (share) ghosts_ = std::make_unique<stencil::GhostExchange>(layout_, *share);
    stencil::load(layout_, grid.tree(), 0, states_[0].now.now());
    const stencil::FieldSummary given = summarize(layout_, states_[0].now.now(), team());
    active_ = given.count + given.non_finite;
    if (given.non_finite)
        throw InvalidInput(
            fmt::format("{} of {} values are NaN or infinite; --threshold or --mask leaves them out",
                        given.non_finite, given.count + given.non_finite));
    range_ = static_cast<double>(given.max) - given.min;
    offset_ = static_cast<float>(given.mean());
    for (State& s : states_) stencil::load(layout_, grid.tree(), offset_, s.now.now());
    if (fields_.size() == 1 && fields_[0].coupling > 0) {
        input_ = BlockField(layout_.brick_count());
        stencil::load(layout_, grid.tree(), offset_, input_.brick(0));
    }
    summary_.assign(fields_.size(), summarize(layout_, states_[0].now.now(), team()));
    mean_before_ = mean();
}

double DiffusionSolver::bound() const {
    const double lambda = 4 * weights_.sum();
    double largest = 0, coupling = 0;
    for (const Field& f : fields_) {
        double rate = 0;
        for (const DiffusionTerm& t : f.terms) rate += t.diffusivity * std::pow(lambda, t.order + 1);
        largest = std::max(largest, rate);
        coupling += f.coupling;
    }
    return largest + coupling > 0 ? 2 / (largest + coupling) : std::numeric_limits<double>::infinity();
}

double DiffusionSolver::step(Stepper stepper, const std::optional<double>& dt) const {
    constexpr double safety = 0.9, implicit = 20;
    const double largest = stepper == Stepper::adi ? implicit * bound() : bound();
    if (team() && stepper == Stepper::adi)
        throw InvalidInput("the stepper adi solves along whole lines of the map: parts of it will not do");
    if (dt && *dt > largest)
        throw InvalidInput(fmt::format("dt = {:g} is above the stability bound {:.6g}", *dt, largest));
    return dt.value_or(safety * largest);
}

/// The fields' bricks as they are now; `before`: and as they were a step ago, behind.
std::vector<float*> DiffusionSolver::states(bool before) {
    std::vector<float*> all;
    for (State& s : states_) all.push_back(s.now.now());
    if (before)
        for (State& s : states_) all.push_back(s.before.now());
    return all;
}

/// Coefficients of all fields, those of ghosts too: they come from their owners.
void DiffusionSolver::freeze() {
    if (constant_coefficients()) return;
    for (std::size_t i = 0; i < fields_.size(); ++i) freeze(i);
    if (!ghosts_) return;
    std::vector<float*> found;
    for (State& s : states_)
        for (BlockField& d : s.diffusivities)
            if (!d.empty()) found.push_back(d.brick(0));
    ghosts_->run(found);
}

/// A sweep, and what other members need of it on its way while it goes on.
void DiffusionSolver::take_sweep(stencil::SweepPlan& plan, const Progress& progress) {
    if (!ghosts_) return sweep(layout_, plan, progress);
    const std::vector<float*> read = states(!plan.begins);
    std::vector<const float*> written;
    for (State& s : states_) written.push_back(s.now.next());
    if (!plan.ends)
        for (State& s : states_) written.push_back(s.before.next());
    ghosts_->begin(written.size());
    plan.before_slab = [&](std::size_t slab) { ghosts_->fill_around(slab, read); };
    plan.after_slab = [&](std::size_t slab) { ghosts_->send(slab, written); };
    sweep(layout_, plan, progress);
}

void DiffusionSolver::freeze(std::size_t field) {
    State& s = states_[field];
    const float* u = s.now.now();
    for (std::size_t i = 0; i < s.diffusivities.size(); ++i) {
        const DiffusionTerm& term = fields_[field].terms[i];
        if (s.diffusivities[i].empty()) continue;
        stencil::Diffusivity d;
        d.factor = term.diffusivity;
        d.of_gradient = term.order > 0;
        d.scale = sigma_.factor * sigma_.factor;
        d.floor = std::max(std::pow(1e-6 * range_, 2), 1e-37);
        d.radius = sigma_.kind == EdgeScale::Kind::local ? sigma_.radius : 0;
        if (sigma_.kind == EdgeScale::Kind::value) d.sigma_squared = sigma_.value * sigma_.value;
        if (sigma_.kind == EdgeScale::Kind::global)
            d.sigma_squared = d.scale * (d.of_gradient ? gradient_variance(layout_, u, weights_, team())
                                                       : summary_[field].variance());
        diffusivity(layout_, u, weights_, d, s.diffusivities[i].brick(0));
    }
}

stencil::SweepPlan DiffusionSolver::plan() {
    stencil::SweepPlan p;
    p.weights = weights_;
    for (std::size_t i = 0; i < fields_.size(); ++i) {
        stencil::SweepField f;
        f.state = &states_[i].now;
        f.before = &states_[i].before;
        f.coupling = fields_[i].coupling;
        if (!input_.empty()) f.target = input_.brick(0);
        for (std::size_t t = 0; t < fields_[i].terms.size(); ++t) {
            const DiffusionTerm& term = fields_[i].terms[t];
            const bool variable = t < states_[i].diffusivities.size() && !states_[i].diffusivities[t].empty();
            f.terms.push_back({term.order, variable ? states_[i].diffusivities[t].brick(0) : nullptr,
                               variable ? 1.0 : term.diffusivity});
        }
        p.fields.push_back(std::move(f));
    }
    return p;
}

void DiffusionSolver::cycle(Stepper stepper, int n, double tau, const Progress& progress) {
    freeze();
    if (stepper == Stepper::adi) {
        for (int k = 0; k < n; ++k) {
            implicit_step(tau);
            progress.report(double(k + 1) / n);
        }
        check();
        return;
    }
    int top = 0;
    for (const Field& f : fields_) top = std::max(top, f.terms.back().order);
    const int most = stencil::steps_per_sweep(top), sweeps = (n + most - 1) / most;
    for (int s = 0, k = 0; s < sweeps; ++s) {
        stencil::SweepPlan p = plan();
        const int end = static_cast<int>(static_cast<std::int64_t>(n) * (s + 1) / sweeps);
        for (; k < end; ++k) p.steps.push_back({stepper == Stepper::fsi ? fsi_relaxation(k) : 1.0, tau});
        p.begins = s == 0 || stepper != Stepper::fsi;
        p.ends = s + 1 == sweeps || stepper != Stepper::fsi;
        take_sweep(p, progress.part(double(s) / sweeps, double(s + 1) / sweeps));
    }
    check();
    if (ghosts_) ghosts_->fill_all(states(false));
}

/// u += Π_a (I + θ τ A_a)^{-1} τ A u, where A is the whole operator and A_a = Σ_q L_{d,a} L_a^q: first order
/// in time for any θ. With constant coefficients (Σλ_a)^{q+1} ≤ 3^q Σ λ_a^{q+1}, so an amplitude changes by
/// at most 3^q/θ times itself: in a box stable for θ ≥ 3^q/2, whatever τ. On other masks the A_a do not
/// commute: a hundred times the explicit bound diverges there, and so it does with a larger θ.
void DiffusionSolver::implicit_step(double tau) {
    stencil::SweepPlan p = plan();
    p.steps = {{1.0, tau}};
    p.ends = false;  // u_k stays, in `before`
    sweep(layout_, p);
    for (std::size_t i = 0; i < fields_.size(); ++i) {
        const double theta = std::max(1.0, 0.5 * std::pow(3.0, fields_[i].terms.back().order));
        float* next = states_[i].now.now();
        const float* here = states_[i].before.now();
        const std::size_t values = layout_.brick_count() * BlockField::brick_size;
        const auto damping = static_cast<float>(1 / (1 + theta * tau * fields_[i].coupling));
        parallel_blocks(values, 1 << 15, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) next[k] = (next[k] - here[k]) * damping;
        });
        solve_lines(layout_, p.fields[i].terms, weights_, theta * tau, next);
        parallel_blocks(values, 1 << 15, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) next[k] += here[k];
        });
    }
}

void DiffusionSolver::run(Stepper stepper, const CycleRun& cycles, HyperdiffusionReport& report,
                          const Progress& progress) {
    // With constant coefficients Euler's steps need no cycles: many go into one pass.
    const int most = stepper == Stepper::euler && constant_coefficients() ? 64 : 1;
    for (int done = 0; done < cycles.cycles;) {
        const int together = std::min(most, cycles.cycles - done);
        cycle(stepper, cycles.n * together, cycles.tau,
              progress.part(double(done) / cycles.cycles, double(done + together) / cycles.cycles));
        done += together;
    }
    report.steps += cycles.cycles * cycles.n;
    report.cycles += cycles.cycles;
    report.time += cycles.cycles * cycle_time(stepper, cycles.n, cycles.tau);
    report.dt = cycles.tau;
}

void DiffusionSolver::run(Stepper stepper, const std::vector<CycleRun>& cycles, HyperdiffusionReport& report,
                          const Progress& progress) {
    double all = 0, done = 0;
    for (const CycleRun& r : cycles) all += double(r.cycles) * r.n;
    for (const CycleRun& r : cycles) {
        const double share = double(r.cycles) * r.n;
        run(stepper, r, report, progress.part(done / all, (done + share) / all));
        done += share;
    }
}

void DiffusionSolver::describe(HyperdiffusionReport& report) const {
    report.active_voxels = active_voxels();
    report.mean_before = mean_before_;
    report.mean_after = mean();
    report.state_bytes = state_bytes();
    report.bytes_sent = bytes_sent();
    report.removed = removed();
}

void DiffusionSolver::check() {
    for (std::size_t i = 0; i < fields_.size(); ++i) {
        summary_[i] = summarize(layout_, states_[i].now.now(), team());
        if (summary_[i].non_finite)
            throw NumericalError("the values diverged: a smaller --dt or --diffusivity is needed");
    }
    // Coupled fields exchange what they hold; the mean of each is not kept then.
    if (fields_.size() == 1 && std::abs(mean() - mean_before_) > drift_limit * std::max(range_, 1e-300))
        throw NumericalError(fmt::format("the mean drifted from {:.7g} to {:.7g}", mean_before_, mean()));
}

void DiffusionSolver::reset() {
    for (State& s : states_) stencil::load(layout_, grid_.tree(), offset_, s.now.now());
    for (stencil::FieldSummary& s : summary_) s = summarize(layout_, states_[0].now.now(), team());
}

double DiffusionSolver::removed() const {
    const float* now = states_[0].now.now();
    const auto part = [&](std::size_t b, double& sum) {
        const float* x = grid_.tree().probeConstLeaf(layout_.origin(b))->buffer().data();
        const float* u = now + b * BlockField::brick_size;
        for (std::size_t w = 0; w < 8; ++w)
            for (std::uint64_t word = layout_.mask(b)[w]; word; word &= word - 1) {
                const std::size_t i = 64 * w + static_cast<std::size_t>(__builtin_ctzll(word));
                const double d = static_cast<double>(x[i] - offset_) - u[i];
                sum += d * d;
            }
    };
    const double sum =
        sum_bricks(layout_, team(), 0.0, part, [](double& total, double value) { total += value; });
    return std::sqrt(sum / std::max(1.0, static_cast<double>(active_)));
}

void DiffusionSolver::store(openvdb::FloatGrid& grid) const {
    if (fields_.size() == 1) {
        stencil::store(layout_, states_[0].now.now(), offset_, grid.tree());
        return;
    }
    BlockField difference(layout_.brick_count());
    const float *u = states_[0].now.now(), *v = states_[1].now.now();
    parallel_blocks(layout_.brick_count() * BlockField::brick_size, 1 << 15,
                    [&](std::size_t begin, std::size_t end) {
                        for (std::size_t i = begin; i < end; ++i) difference.brick(0)[i] = u[i] - v[i];
                    });
    stencil::store(layout_, difference.brick(0), 0, grid.tree());
}

std::size_t DiffusionSolver::state_bytes() const {
    std::size_t bytes = layout_.memory() + (input_.empty() ? 0 : input_.memory());
    for (const State& s : states_) {
        bytes += s.now.memory() + s.before.memory();
        for (const BlockField& d : s.diffusivities) bytes += d.empty() ? 0 : d.memory();
    }
    return bytes;
}

}  // namespace vdbgeo
