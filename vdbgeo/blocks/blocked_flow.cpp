#include "vdbgeo/blocks/blocked_flow.h"

#include <algorithm>
#include <optional>

#include "vdbgeo/core/freed_memory.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/flow/diffusion_fields.h"

namespace vdbgeo {

using openvdb::CoordBBox;
using openvdb::FloatGrid;
using stencil::BlockField;
using stencil::BlockLayout;

namespace {

void clear(BlockField& field) {
    parallel_blocks(field.bricks(), 256, [&](std::size_t begin, std::size_t end) {
        std::fill(field.brick(begin), field.brick(end), 0.0f);
    });
}

}  // namespace

BlockedFlow::BlockedFlow(MapSource source, const GeometricFlowOptions& options, const BlockOptions& blocks,
                         const Progress& progress)
    : options_(options),
      map_(std::move(source), blocks),
      rate_of_(options, axis_weights(*map_.source().transform)) {
    before_ = map_.survey(progress.part(0, 0.5));
    BlockWork work;
    work.last_reach = 2 * rate_of_.reach();
    work.bytes_a_brick = 2400 + (options.fidelity != 0 ? 3 : 2) * 2048.0 + 96;
    plan_ = map_.plan(work);
    if (before_.count > 0) find_first_bound(progress.part(0.5, 1));
}

void BlockedFlow::find_first_bound(const Progress& progress) {
    for (std::size_t i = 0; i < plan_.blocks.size(); ++i) {
        const FloatGrid::Ptr grid = map_.read(grown(plan_.blocks[i], rate_of_.reach()));
        const BlockLayout layout(grid->tree(), plan_.blocks[i]);
        BlockField state(layout.brick_count()), rate(layout.brick_count());
        stencil::load(layout, grid->tree(), 0, state.brick(0));
        row_sum_ = std::max(row_sum_, rate_of_(layout, state.brick(0), state.brick(0), rate.brick(0)));
        progress.report(double(i + 1) / double(plan_.blocks.size()));
    }
}

void BlockedFlow::take_block(const CoordBBox& own, float dt, stencil::FieldTotal& total, double& row_sum) {
    const CoordBBox box = grown(own, plan_.halo);
    const BrickIndex::Part bricks = map_.index().part(box);
    BlockLayout layout(bricks.leaves, own);
    BlockField state(layout.brick_count()), rate(layout.brick_count()), input;
    if (options_.fidelity != 0) {
        input = BlockField(layout.brick_count());
        stencil::load(layout, map_.read(box)->tree(), 0, input.brick(0));
    }
    const std::size_t values = layout.brick_count() * BlockField::brick_size;
    if (state_.now)
        state_.now->read(bricks.runs, state.brick(0));
    else
        stencil::load(layout, map_.read(box)->tree(), 0, state.brick(0));
    if (!state_.now || options_.fidelity != 0) give_memory_back();  // what the grids took
    clear(rate);
    memory_ = std::max(memory_, layout.memory() + state.memory() + rate.memory());
    layout.work_on(grown(own, rate_of_.reach()));
    const float* const x = input.empty() ? nullptr : input.brick(0);
    rate_of_(layout, state.brick(0), x, rate.brick(0));
    float* s = state.brick(0);
    const float* r = rate.brick(0);
    parallel_for(values, 1 << 14, [=](std::size_t i) { s[i] += dt * r[i]; });
    layout.work_on(own);
    total.add(layout, s);
    next_of(state_, map_.options().scratch).write(BrickIndex::within(bricks, own), s);
    row_sum = std::max(row_sum, rate_of_(layout, s, x, rate.brick(0)));
}

stencil::FieldSummary BlockedFlow::take(double dt) {
    stencil::FieldTotal total;
    double row_sum = 0;
    std::optional<BlockField::Reuse> reuse;  // not where grids are read as well
    if (state_.now && options_.fidelity == 0) reuse.emplace();
    for (const CoordBBox& own : plan_.blocks) take_block(own, static_cast<float>(dt), total, row_sum);
    state_.turn();
    row_sum_ = row_sum;
    return total.summary();
}

ExactSum BlockedFlow::store(const CoordBBox& box, openvdb::FloatTree& part) const {
    if (!state_.now) return {};
    const BlockedMap::Field s = map_.field_in(box, *state_.now);
    const ExactSum squares = squared_change(s.layout, part, 0, s.values.brick(0));
    stencil::store(s.layout, s.values.brick(0), 0, part);
    return squares;
}

std::unique_ptr<BlockedFlow> geometric_flow_blocks(const MapSource& source,
                                                   const GeometricFlowOptions& options,
                                                   const BlockOptions& blocks, HyperdiffusionReport& report,
                                                   const Progress& progress) {
    options.check();
    auto flow = std::make_unique<BlockedFlow>(source, options, blocks, progress.part(0, 0.1));
    if (flow->before().count == 0) return nullptr;
    report.active_voxels = flow->before().count;
    take_flow_steps(*flow, flow->before(), options, report, progress.part(0.1, 1));
    report.state_bytes = flow->memory();
    report.blocks = flow->blocks();
    return flow;
}

}  // namespace vdbgeo
