#include "vdbgeo/flow/diffusion_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/flow/cycles.h"
#include "vdbgeo/stencil/brick_sums.h"
#include "vdbgeo/stencil/diffusivity.h"
#include "vdbgeo/stencil/line_solve.h"

namespace vdbgeo {

using stencil::BlockField;
using stencil::BlockLayout;

DiffusionProblem::DiffusionProblem(std::vector<Field> given, const EdgeScale& scale,
                                   const Vec3d& axis_weights)
    : fields(std::move(given)), sigma(scale), weights(axis_weights) {
    for (Field& f : fields) {
        f.terms.erase(std::remove_if(f.terms.begin(), f.terms.end(),
                                     [](const DiffusionTerm& t) { return t.diffusivity == 0; }),
                      f.terms.end());
        if (f.terms.empty()) f.terms = {{0, 0.0}};  // a field that only follows its target
        std::sort(f.terms.begin(), f.terms.end(),
                  [](const DiffusionTerm& a, const DiffusionTerm& b) { return a.order < b.order; });
    }
}

int DiffusionProblem::highest_order() const {
    int top = 0;
    for (const Field& f : fields) top = std::max(top, f.terms.back().order);
    return top;
}

int DiffusionProblem::reach_of_coefficients() const {
    if (constant_coefficients()) return 0;
    return sigma.kind == EdgeScale::Kind::local ? sigma.radius + 1 : 1;
}

double DiffusionProblem::bound() const {
    const double lambda = 4 * weights.sum();
    double largest = 0, coupling = 0;
    for (const Field& f : fields) {
        double rate = 0;
        for (const DiffusionTerm& t : f.terms) rate += t.diffusivity * std::pow(lambda, t.order + 1);
        largest = std::max(largest, rate);
        coupling += f.coupling;
    }
    return largest + coupling > 0 ? 2 / (largest + coupling) : std::numeric_limits<double>::infinity();
}

double DiffusionProblem::step(Stepper stepper, const std::optional<double>& dt) const {
    constexpr double safety = 0.9, implicit = 20;
    const double largest = stepper == Stepper::adi ? implicit * bound() : bound();
    if (dt && *dt > largest)
        throw InvalidInput(fmt::format("dt = {:g} is above the stability bound {:.6g}", *dt, largest));
    return dt.value_or(safety * largest);
}

std::vector<CycleSweep> sweeps_of_cycle(Stepper stepper, int n, double tau, int highest_order) {
    const int most = stencil::steps_per_sweep(highest_order), count = (n + most - 1) / most;
    std::vector<CycleSweep> sweeps(static_cast<std::size_t>(count));
    for (int s = 0, k = 0; s < count; ++s) {
        CycleSweep& sweep = sweeps[static_cast<std::size_t>(s)];
        const int end = static_cast<int>(static_cast<std::int64_t>(n) * (s + 1) / count);
        for (; k < end; ++k) sweep.steps.push_back({stepper == Stepper::fsi ? fsi_relaxation(k) : 1.0, tau});
        sweep.begins = s == 0 || stepper != Stepper::fsi;
        sweep.ends = s + 1 == count || stepper != Stepper::fsi;
    }
    return sweeps;
}

DiffusionFields::DiffusionFields(const DiffusionProblem& problem, BlockLayout layout)
    : problem_(problem), layout_(std::move(layout)) {
    for (const DiffusionProblem::Field& f : problem.fields) {
        State s{stencil::ShiftedField(layout_), stencil::ShiftedField(layout_), {}};
        if (!problem.constant_coefficients())
            for (const DiffusionTerm& t : f.terms)
                s.diffusivities.push_back(t.diffusivity > 0 ? BlockField(layout_.brick_count())
                                                            : BlockField());
        states_.push_back(std::move(s));
    }
    if (problem.fields.size() == 1 && problem.fields[0].coupling > 0)
        input_ = BlockField(layout_.brick_count());
}

void DiffusionFields::clear_rest() {
    const auto fill = [](float* begin, const float* end, float value) {
        const auto count = static_cast<std::size_t>(end - begin);
        parallel_blocks(count, 1 << 17, [&](std::size_t from, std::size_t to) {
            std::fill(begin + from, begin + to, value);
        });
    };
    for (State& s : states_) {
        BlockField &now = s.now.all(), &before = s.before.all();
        const std::size_t values = layout_.brick_count() * BlockField::brick_size;
        fill(now.brick(0), s.now.now(), 0);
        fill(s.now.now() + values, now.brick(now.bricks()), 0);
        fill(before.brick(0), before.brick(before.bricks()), 0);
        for (BlockField& d : s.diffusivities)
            if (!d.empty()) fill(d.brick(0), d.brick(d.bricks()), 0);
    }
}

void DiffusionFields::load(const openvdb::FloatTree& x, float offset) {
    for (State& s : states_) stencil::load(layout_, x, offset, s.now.now());
    if (has_input()) load_input(x, offset);
}

void DiffusionFields::load_input(const openvdb::FloatTree& x, float offset) {
    stencil::load(layout_, x, offset, input_.brick(0));
}

std::vector<float*> DiffusionFields::states(bool before) {
    std::vector<float*> all;
    for (State& s : states_) all.push_back(s.now.now());
    if (before)
        for (State& s : states_) all.push_back(s.before.now());
    return all;
}

std::vector<const float*> DiffusionFields::next_states(bool before) {
    std::vector<const float*> all;
    for (State& s : states_) all.push_back(s.now.next());
    if (before)
        for (State& s : states_) all.push_back(s.before.next());
    return all;
}

std::vector<float*> DiffusionFields::coefficients() {
    std::vector<float*> all;
    for (State& s : states_)
        for (BlockField& d : s.diffusivities)
            if (!d.empty()) all.push_back(d.brick(0));
    return all;
}

void DiffusionFields::freeze(const EdgeMeasure& measure) {
    for (std::size_t i = 0; i < states_.size(); ++i) freeze(i, measure);
}

void DiffusionFields::freeze(std::size_t field, const EdgeMeasure& measure) {
    State& s = states_[field];
    const EdgeScale& sigma = problem_.sigma;
    for (std::size_t i = 0; i < s.diffusivities.size(); ++i) {
        const DiffusionTerm& term = problem_.fields[field].terms[i];
        if (s.diffusivities[i].empty()) continue;
        stencil::Diffusivity d;
        d.factor = term.diffusivity;
        d.of_gradient = term.order > 0;
        d.scale = sigma.factor * sigma.factor;
        d.floor = std::max(std::pow(1e-6 * measure.range, 2), 1e-37);
        d.radius = sigma.kind == EdgeScale::Kind::local ? sigma.radius : 0;
        if (sigma.kind == EdgeScale::Kind::value) d.sigma_squared = sigma.value * sigma.value;
        if (sigma.kind == EdgeScale::Kind::global) d.sigma_squared = d.scale * measure.variance[field][i];
        diffusivity(layout_, s.now.now(), problem_.weights, d, s.diffusivities[i].brick(0));
    }
}

stencil::SweepPlan DiffusionFields::plan(const CycleSweep& sweep) {
    stencil::SweepPlan p;
    p.weights = problem_.weights;
    p.steps = sweep.steps;
    p.begins = sweep.begins;
    p.ends = sweep.ends;
    for (std::size_t i = 0; i < states_.size(); ++i) {
        const DiffusionProblem::Field& of = problem_.fields[i];
        stencil::SweepField f;
        f.state = &states_[i].now;
        f.before = &states_[i].before;
        f.coupling = of.coupling;
        if (!input_.empty()) f.target = input_.brick(0);
        for (std::size_t t = 0; t < of.terms.size(); ++t) {
            const bool variable = t < states_[i].diffusivities.size() && !states_[i].diffusivities[t].empty();
            f.terms.push_back({of.terms[t].order, variable ? states_[i].diffusivities[t].brick(0) : nullptr,
                               variable ? 1.0 : of.terms[t].diffusivity});
        }
        p.fields.push_back(std::move(f));
    }
    return p;
}

/// First order in time for any θ. With constant coefficients (Σλ_a)^{q+1} ≤ 3^q Σ λ_a^{q+1}, so an amplitude
/// changes by at most 3^q/θ times itself: in a box stable for θ ≥ 3^q/2, whatever τ. On other masks the A_a
/// do not commute: a hundred times the explicit bound diverges there, and so it does with a larger θ.
void DiffusionFields::implicit_step(double tau) {
    stencil::SweepPlan p = plan({{{1.0, tau}}, true, false});  // u_k stays, in `before`
    sweep(layout_, p);
    for (std::size_t i = 0; i < states_.size(); ++i) {
        const double theta = std::max(1.0, 0.5 * std::pow(3.0, problem_.fields[i].terms.back().order));
        float* next = states_[i].now.now();
        const float* here = states_[i].before.now();
        const std::size_t values = layout_.brick_count() * BlockField::brick_size;
        const auto damping = static_cast<float>(1 / (1 + theta * tau * problem_.fields[i].coupling));
        parallel_blocks(values, 1 << 15, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) next[k] = (next[k] - here[k]) * damping;
        });
        solve_lines(layout_, p.fields[i].terms, problem_.weights, theta * tau, next);
        parallel_blocks(values, 1 << 15, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) next[k] += here[k];
        });
    }
}

void DiffusionFields::store(float offset, openvdb::FloatTree& tree) const {
    if (states_.size() == 1) {
        stencil::store(layout_, now(), offset, tree);
        return;
    }
    BlockField difference(layout_.brick_count());
    const float *u = now(0), *v = now(1);
    parallel_blocks(layout_.brick_count() * BlockField::brick_size, 1 << 15,
                    [&](std::size_t begin, std::size_t end) {
                        for (std::size_t i = begin; i < end; ++i) difference.brick(0)[i] = u[i] - v[i];
                    });
    stencil::store(layout_, difference.brick(0), 0, tree);
}

std::size_t DiffusionFields::memory() const {
    std::size_t bytes = layout_.memory() + (input_.empty() ? 0 : input_.memory());
    for (const State& s : states_) {
        bytes += s.now.memory() + s.before.memory();
        for (const BlockField& d : s.diffusivities) bytes += d.empty() ? 0 : d.memory();
    }
    return bytes;
}

std::size_t DiffusionFields::bytes_a_brick(const DiffusionProblem& problem) {
    constexpr std::size_t brick = BlockField::brick_size * sizeof(float), table = 96;
    std::size_t fields = 0;
    for (const DiffusionProblem::Field& f : problem.fields)
        fields += 2 + (problem.constant_coefficients() ? 0 : f.terms.size());
    if (problem.fields.size() == 1 && problem.fields[0].coupling > 0) ++fields;
    return fields * brick + table;
}

ExactSum squared_change(const BlockLayout& layout, const openvdb::FloatTree& x, float offset,
                        const float* u) {
    return stencil::sum_of_bricks<ExactSum>(layout, [&](std::size_t brick, ExactSum& total) {
        const float* const of_x = x.probeConstLeaf(layout.origin(brick))->buffer().data();
        const float* const of_u = u + brick * BlockField::brick_size;
        double sum = 0;
        for (std::size_t w = 0; w < 8; ++w)
            for (std::uint64_t word = layout.mask(brick)[w]; word; word &= word - 1) {
                const std::size_t i = 64 * w + static_cast<std::size_t>(__builtin_ctzll(word));
                const double d = static_cast<double>(of_x[i] - offset) - of_u[i];
                sum += d * d;
            }
        total.add(sum);
    });
}

double root_mean_square(const ExactSum& sum, std::uint64_t count) {
    return std::sqrt(sum.value() / std::max(1.0, static_cast<double>(count)));
}

}  // namespace vdbgeo
