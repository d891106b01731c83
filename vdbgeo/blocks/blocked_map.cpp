#include "vdbgeo/blocks/blocked_map.h"

#include <algorithm>

#include "vdbgeo/flow/diffusion_solver.h"

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

CoordBBox grown(CoordBBox box, int by) {
    box.expand(by);
    return box;
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

BlockedMap::Field BlockedMap::field_in(const CoordBBox& box, const BrickFile& file) const {
    const BrickIndex::Part bricks = index_.part(box);
    Field field{BlockLayout(bricks.leaves), BlockField(bricks.leaves.size())};
    file.read(bricks.runs, field.values.brick(0));
    return field;
}

}  // namespace vdbgeo
