#include "vdbgeo/blocks/blocked_diffusion.h"

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/freed_memory.h"
#include "vdbgeo/flow/checkpoint.h"
#include "vdbgeo/flow/diffusion_solver.h"
#include "vdbgeo/flow/noise.h"
#include "vdbgeo/flow/state_file.h"
#include "vdbgeo/stencil/diffusivity.h"
#include "vdbgeo/stencil/tiles.h"

namespace vdbgeo {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using stencil::BlockField;
using stencil::BlockLayout;
using stencil::FieldTotal;
using stencil::GradientTotal;

namespace {

BlockField zeros(std::size_t bricks) {
    BlockField field(bricks);
    std::fill_n(field.brick(0), bricks * BlockField::brick_size, 0.0f);
    return field;
}

}  // namespace

/// Some steps of a cycle.
struct BlockedDiffusion::Part {
    const std::vector<CycleSweep>* sweeps;
    std::size_t first, last;  // of them
    const BlockWork* work;
    int halo;

    bool begins() const { return first == 0; }
    bool ends() const { return last == sweeps->size(); }
    int steps_from(std::size_t sweep) const {
        std::size_t n = 0;
        for (std::size_t s = sweep; s < last; ++s) n += (*sweeps)[s].steps.size();
        return static_cast<int>(n);
    }
};

/// What a cycle leaves, of the whole map.
struct BlockedDiffusion::Totals {
    std::vector<FieldTotal> fields;
    std::vector<GradientTotal> gradients;  // of each field, where σ is global and a term looks at it

    explicit Totals(const DiffusionProblem& problem) : fields(problem.fields.size()) {
        if (problem.sigma.kind == EdgeScale::Kind::global && problem.highest_order() > 0)
            gradients.assign(problem.fields.size(), GradientTotal(problem.weights));
    }
    void add(const BlockLayout& layout, std::size_t field, const float* u) {
        fields[field].add(layout, u);
        if (!gradients.empty()) gradients[field].add(layout, u);
    }
};

BlockedDiffusion::BlockedDiffusion(MapSource source, std::vector<DiffusionProblem::Field> fields,
                                   const EdgeScale& sigma, const BlockOptions& options,
                                   const Progress& progress)
    : map_(std::move(source), options),
      problem_(std::move(fields), sigma, axis_weights(*map_.source().transform)) {
    const stencil::FieldSummary given = map_.survey(progress.part(0, 0.5));
    first_measure_.range = static_cast<double>(given.max) - given.min;
    offset_ = static_cast<float>(given.mean());
    before_.count = given.count;
    if (before_.count > 0) find_edges(progress.part(0.5, 1));
    summary_.assign(problem_.fields.size(), before_);
}

/// What the first cycle has to know of X less its mean.
void BlockedDiffusion::find_edges(const Progress& progress) {
    Totals totals(problem_);
    const BlockPlan plan = map_.reading_plan(1);
    for (std::size_t i = 0; i < plan.blocks.size(); ++i) {
        const FloatGrid::Ptr grid = map_.read(grown(plan.blocks[i], plan.halo));
        const BlockLayout layout(grid->tree(), plan.blocks[i]);
        BlockField x(layout.brick_count());
        stencil::load(layout, grid->tree(), offset_, x.brick(0));
        for (std::size_t f = 0; f < problem_.fields.size(); ++f) totals.add(layout, f, x.brick(0));
        input_hash_ += stencil::hash_of_bricks(layout, x.brick(0));
        progress.report(double(i + 1) / double(plan.blocks.size()));
    }
    before_ = totals.fields[0].summary();
    measure_ = first_measure_;
    keep(totals);
    first_measure_ = measure_;
}

void BlockedDiffusion::keep(const Totals& totals) {
    summary_.clear();
    for (const FieldTotal& t : totals.fields) summary_.push_back(t.summary());
    measure_.variance.clear();
    for (std::size_t i = 0; i < problem_.fields.size(); ++i) {
        const double of_gradient = totals.gradients.empty() ? 0 : totals.gradients[i].variance();
        std::vector<double>& of_terms = measure_.variance.emplace_back();
        for (const DiffusionTerm& t : problem_.fields[i].terms)
            of_terms.push_back(t.order > 0 ? of_gradient : summary_[i].variance());
    }
}

double BlockedDiffusion::step(Stepper stepper, const std::optional<double>& dt) const {
    if (stepper == Stepper::adi)
        throw InvalidInput("the stepper adi solves along whole lines of the map: blocks of it will not do");
    return problem_.step(stepper, dt);
}

BlockWork BlockedDiffusion::work_of(Stepper stepper, int n) const {
    BlockWork work;
    work.steps = n;
    const auto sweeps = sweeps_of_cycle(stepper, n, 0, problem_.highest_order());
    for (const CycleSweep& s : sweeps)
        work.steps_a_sweep = std::max(work.steps_a_sweep, static_cast<int>(s.steps.size()));
    work.reach = problem_.highest_order() + 1;
    work.first_reach = problem_.reach_of_coefficients();
    const bool global = problem_.sigma.kind == EdgeScale::Kind::global;
    work.last_reach = global && problem_.highest_order() > 0 ? 1 : 0;
    work.bytes_a_brick = static_cast<double>(DiffusionFields::bytes_a_brick(problem_)) + 80;
    work.bytes_of_window = 2.0 * static_cast<double>(problem_.fields.size()) * 2048;
    return work;
}

void BlockedDiffusion::cycle(Stepper stepper, int n, double tau, const Progress& progress) {
    const auto sweeps = sweeps_of_cycle(stepper, n, tau, problem_.highest_order());
    const BlockWork work = work_of(stepper, n);
    const BlockPlan plan = map_.plan(work);
    const auto a_part = static_cast<std::size_t>(std::max(1, plan.steps / work.steps_a_sweep));
    most_blocks_ = std::max(most_blocks_, plan.blocks.size());
    for (std::size_t first = 0; first < sweeps.size(); first += a_part) {
        const Part part{&sweeps, first, std::min(first + a_part, sweeps.size()), &work, plan.halo};
        Totals totals(problem_);
        // Not where grids are read as well: what is kept would be there beside them.
        std::optional<BlockField::Reuse> reuse;
        if (!is_input_ && !reads_input()) reuse.emplace();
        for (std::size_t b = 0; b < plan.blocks.size(); ++b) {
            take_part(part, plan.blocks[b], totals);
            const double done =
                double(first) + double(part.last - first) * double(b + 1) / double(plan.blocks.size());
            progress.report(done / double(sweeps.size()));
        }
        for (BrickGenerations& g : now_) g.turn();
        for (BrickGenerations& g : step_before_) g.turn();
        is_input_ = false;
        if (part.ends()) keep(totals);
    }
    step_before_.clear();
    coefficients_.clear();
    check_diverged(summary_, before_, offset_);
}

void BlockedDiffusion::take_part(const Part& part, const CoordBBox& own, Totals& totals) {
    const CoordBBox box = grown(own, part.halo);
    const BrickIndex::Part bricks = map_.index().part(box);
    DiffusionFields fields(problem_, BlockLayout(bricks.leaves, own));
    most_memory_ = std::max(most_memory_, fields.memory());
    load(part, bricks, box, fields);
    const int after = part.ends() ? part.work->last_reach : 0, reach = part.work->reach;
    BlockLayout& layout = fields.layout();
    if (part.begins()) {
        layout.work_on(grown(own, part.steps_from(part.first) * reach + after));
        fields.freeze(measure_);
    }
    for (std::size_t s = part.first; s < part.last; ++s) {
        layout.work_on(grown(own, part.steps_from(s + 1) * reach + after));
        stencil::SweepPlan plan = fields.plan((*part.sweeps)[s]);
        sweep(layout, plan);
    }
    layout.work_on(own);
    if (part.ends())
        for (std::size_t f = 0; f < problem_.fields.size(); ++f) totals.add(layout, f, fields.now(f));
    put_down(part, bricks, own, fields);
}

void BlockedDiffusion::load(const Part& part, const BrickIndex::Part& bricks, const CoordBBox& box,
                            DiffusionFields& fields) const {
    if (is_input_) {
        fields.load(map_.read(box)->tree(), offset_);
    } else {
        if (reads_input()) fields.load_input(map_.read(box)->tree(), offset_);
        for (std::size_t f = 0; f < now_.size(); ++f) now_[f].now->read(bricks.runs, fields.now(f));
    }
    if (is_input_ || reads_input())
        give_memory_back();  // what the grid took goes back before the fields grow
    fields.clear_rest();
    if (part.begins()) return;
    const std::vector<float*> d = fields.coefficients();
    for (std::size_t i = 0; i < d.size(); ++i) coefficients_[i]->read(bricks.runs, d[i]);
    for (std::size_t f = 0; f < step_before_.size(); ++f)
        if (step_before_[f].now) step_before_[f].now->read(bricks.runs, fields.before(f));
}

void BlockedDiffusion::put_down(const Part& part, const BrickIndex::Part& bricks, const CoordBBox& own,
                                DiffusionFields& fields) {
    const std::vector<BrickIndex::Run> runs = BrickIndex::within(bricks, own);
    const std::filesystem::path& scratch = map_.options().scratch;
    now_.resize(problem_.fields.size());
    for (std::size_t f = 0; f < now_.size(); ++f) next_of(now_[f], scratch).write(runs, fields.now(f));
    if (part.ends()) return;
    if (!(*part.sweeps)[part.last - 1].ends) {
        step_before_.resize(problem_.fields.size());
        for (std::size_t f = 0; f < step_before_.size(); ++f)
            next_of(step_before_[f], scratch).write(runs, fields.before(f));
    }
    if (!part.begins()) return;
    const std::vector<float*> d = fields.coefficients();
    coefficients_.resize(d.size());
    for (std::size_t i = 0; i < d.size(); ++i) {
        if (!coefficients_[i]) coefficients_[i] = std::make_unique<BrickFile>(scratch);
        coefficients_[i]->write(runs, d[i]);
    }
}

void BlockedDiffusion::reset() {
    is_input_ = true;
    measure_ = first_measure_;
    summary_.assign(problem_.fields.size(), before_);
}

double BlockedDiffusion::removed() {
    if (is_input_) return 0;
    ExactSum squares;
    for (const CoordBBox& own : map_.reading_plan(0).blocks) {
        const FloatGrid::Ptr x = map_.read(own);
        const BlockedMap::Field u = map_.field_in(own, *now_[0].now);
        squares.add(squared_change(u.layout, x->tree(), offset_, u.values.brick(0)));
    }
    return root_mean_square(squares, active_voxels());
}

/// For what goes through all fields, a block at a time.
BlockPlan BlockedDiffusion::copying_plan(int ghosts) const {
    BlockWork work;
    work.last_reach = ghosts;
    work.bytes_a_brick = static_cast<double>(problem_.fields.size()) * 2048 + 96;
    return map_.plan(work);
}

void BlockedDiffusion::save(StateWriter& writer) {
    for (const CoordBBox& own : copying_plan(0).blocks) {
        const BrickIndex::Part bricks = map_.index().part(own);
        const BlockLayout layout(bricks.leaves, own);
        std::vector<BlockField> fields;
        std::vector<const float*> now;
        for (const BrickGenerations& g : now_) {
            fields.emplace_back(layout.brick_count());
            g.now->read(bricks.runs, fields.back().brick(0));
            now.push_back(fields.back().brick(0));
        }
        writer.add(layout, now);
    }
}

void BlockedDiffusion::load(const StateReader& reader) {
    const BlockPlan plan = copying_plan(1);
    Totals totals(problem_);
    now_.resize(problem_.fields.size());
    for (BrickGenerations& g : now_)
        if (!g.now) g.now = std::make_unique<BrickFile>(map_.options().scratch);
    for (const CoordBBox& own : plan.blocks) {
        const BrickIndex::Part bricks = map_.index().part(grown(own, plan.halo));
        const BlockLayout layout(bricks.leaves, own);
        std::vector<BlockField> fields;
        std::vector<float*> now;
        for (std::size_t f = 0; f < now_.size(); ++f) {
            fields.emplace_back(layout.brick_count());
            now.push_back(fields.back().brick(0));
        }
        reader.read(layout, now);
        for (std::size_t f = 0; f < now_.size(); ++f) {
            totals.add(layout, f, now[f]);
            now_[f].now->write(BrickIndex::within(bricks, own), now[f]);
        }
    }
    is_input_ = false;
    keep(totals);
}

void BlockedDiffusion::describe(HyperdiffusionReport& report) const {
    report.active_voxels = active_voxels();
    report.mean_before = before_.mean() + offset_;
    report.mean_after = summary_[0].mean() + offset_;
    report.state_bytes = most_memory_ + map_.index().memory();
    report.blocks = most_blocks_;
}

ExactSum BlockedDiffusion::store(const CoordBBox& box, openvdb::FloatTree& part) const {
    const bool difference = problem_.fields.size() == 2;
    if (is_input_) {
        if (difference) {
            const BlockLayout layout(map_.index().part(box).leaves);
            const BlockField nothing = zeros(layout.brick_count());
            stencil::store(layout, nothing.brick(0), 0, part);
        }
        return {};
    }
    BlockedMap::Field u = map_.field_in(box, *now_[0].now);
    const ExactSum squares = squared_change(u.layout, part, offset_, u.values.brick(0));
    if (difference) {
        const BlockedMap::Field v = map_.field_in(box, *now_[1].now);
        for (std::size_t i = 0; i < u.values.bricks() * BlockField::brick_size; ++i)
            u.values.brick(0)[i] -= v.values.brick(0)[i];
    }
    stencil::store(u.layout, u.values.brick(0), difference ? 0 : offset_, part);
    return squares;
}

namespace {

/// removable_noise of the whole, from the cells of its sample.
double noise_of(const MapSource& source, std::uint64_t active) {
    constexpr int spacing = 8;
    give_memory_back();
    FloatGrid::Ptr sample = FloatGrid::create();
    sample->setTransform(source.transform->copy());
    const Coord cell(BlockLayout::size_x, BlockLayout::size_y, BlockLayout::size_z);
    for (const CoordBBox& own : blocks_of(source.box, cell)) {
        if (!in_noise_sample(own.min(), active)) continue;
        const CoordBBox box = grown(own, spacing);
        FloatGrid::Ptr part = source.read(box);
        if (part->tree().hasActiveTiles()) part->tree().voxelizeActiveTiles();
        for (auto leaf = part->tree().cbeginLeaf(); leaf; ++leaf)
            if (box.hasOverlap(leaf->getNodeBoundingBox()) && !sample->tree().probeConstLeaf(leaf->origin()))
                sample->tree().addLeaf(new openvdb::FloatTree::LeafNodeType(*leaf));
    }
    return removable_noise_of_sample(*sample, active);
}

}  // namespace

std::unique_ptr<BlockedDiffusion> hyperdiffuse_blocks(const MapSource& source,
                                                      const HyperdiffusionOptions& options,
                                                      const BlockOptions& blocks,
                                                      HyperdiffusionReport& report,
                                                      const Progress& progress) {
    options.check();
    auto solver = std::make_unique<BlockedDiffusion>(
        source, std::vector<DiffusionProblem::Field>{{options.terms, options.fidelity}}, options.sigma,
        blocks, progress.part(0, 0.1));
    if (solver->active_voxels() == 0) return nullptr;
    report.automatic = !options.time && !options.steps;
    if (report.automatic) report.noise = noise_of(source, solver->active_voxels());
    const double step = solver->step(options.stepper, options.dt);
    report.resumed_cycles = with_checkpoints(
        *solver, blocks.checkpoint, options.text(), nullptr,
        [&](CycleSolver& s) { take_cycles(s, options, step, report.noise, report, progress.part(0.1, 1)); });
    solver->describe(report);
    return solver;
}

std::unique_ptr<BlockedDiffusion> coupled_high_pass_blocks(const MapSource& source,
                                                           const HighPassOptions& options,
                                                           const BlockOptions& blocks,
                                                           HyperdiffusionReport& report,
                                                           const Progress& progress) {
    options.check();
    auto solver = std::make_unique<BlockedDiffusion>(source, high_pass_fields(options), options.sigma, blocks,
                                                     progress.part(0, 0.1));
    if (solver->active_voxels() == 0) return nullptr;
    const double step = solver->step(options.stepper, options.dt);
    report.resumed_cycles = with_checkpoints(
        *solver, blocks.checkpoint, options.text(), nullptr,
        [&](CycleSolver& s) { take_high_pass_cycles(s, options, step, report, progress.part(0.1, 1)); });
    solver->describe(report);
    return solver;
}

}  // namespace vdbgeo
