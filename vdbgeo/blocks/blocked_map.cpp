#include "vdbgeo/blocks/blocked_map.h"

#include <algorithm>
#include <cmath>

#include "vdbgeo/flow/diffusion_fields.h"
#include "vdbgeo/flow/diffusion_solver.h"
#include "vdbgeo/stencil/cell_sums.h"

namespace vdbgeo {

using openvdb::CoordBBox;
using openvdb::FloatGrid;
using stencil::BlockField;
using stencil::BlockLayout;

namespace {

constexpr double grid_bytes = 2400;  // a leaf of a grid, and its share of the tree

}  // namespace

BrickFile& next_of(BrickGenerations& field, const std::filesystem::path& scratch) {
    if (!field.next) field.next = std::make_unique<BrickFile>(scratch);
    return *field.next;
}

CoordBBox cells_within(const CoordBBox& own, int reach) {
    CoordBBox box = own;
    box.expand(reach);
    return cells_of(box);
}

FloatGrid::Ptr BlockedMap::read(const CoordBBox& box) const {
    FloatGrid::Ptr grid = source_.read(box);
    if (grid->tree().hasActiveTiles()) grid->tree().voxelizeActiveTiles();
    return grid;
}

BlockPlan BlockedMap::plan(const BlockWork& work) const {
    const BrickIndex* index = index_.cells().empty() ? nullptr : &index_;
    if (!options_.size) {
        const std::uint64_t held = index_.memory();
        return plan_blocks(source_.box, work, options_.memory > held ? options_.memory - held : 0, index);
    }
    const int steps = std::max(work.steps_a_sweep, std::min(work.steps, options_.steps.value_or(work.steps)));
    return {*options_.size, steps, block_halo(work, steps, true, true),
            blocks_of(source_.box, *options_.size, index)};
}

BlockPlan BlockedMap::reading_plan(int ghosts, int fields) const {
    BlockWork work;
    work.last_reach = ghosts;
    work.bytes_a_brick = grid_bytes + fields * double(BlockField::brick_size * sizeof(float)) + 96;
    return plan(work);
}

stencil::FieldSummary BlockedMap::survey(const Progress& progress) {
    const BlockPlan plan = reading_plan(0);
    stencil::FieldTotal total;
    for (std::size_t i = 0; i < plan.blocks.size(); ++i) {
        const FloatGrid::Ptr grid = read(plan.blocks[i]);
        const BlockLayout layout(grid->tree(), plan.blocks[i]);
        BlockField x(layout.brick_count());
        stencil::load(layout, grid->tree(), 0, x.brick(0));
        total.add(layout, x.brick(0));
        index_.add(layout);
        progress.report(double(i + 1) / double(plan.blocks.size()));
    }
    index_.finish();
    const stencil::FieldSummary given = total.summary();
    check_finite(given);
    return given;
}

double BlockedMap::removed(const BrickFile& u, float offset, std::uint64_t active) const {
    stencil::CellTotal<double> total(0.0, [](double& sum, const double& more) { sum += more; });
    for (const CoordBBox& own : reading_plan(0).blocks) {
        const FloatGrid::Ptr x = read(own);
        const BrickIndex::Part bricks = index_.part(own);
        const BlockLayout layout(bricks.leaves, own);
        BlockField now(layout.brick_count());
        u.read(bricks.runs, now.brick(0));
        total.add(layout, stencil::sum_by_cell(layout, 0.0, [&](std::size_t b, double& sum) {
                      const float* of_x = x->tree().probeConstLeaf(layout.origin(b))->buffer().data();
                      add_removed(of_x, offset, now.brick(b), layout.mask(b), sum);
                  }));
    }
    return std::sqrt(total.total() / std::max(1.0, static_cast<double>(active)));
}

}  // namespace vdbgeo
