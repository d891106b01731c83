#include "vdbgeo/volume/grid_builder.h"

#include <fmt/format.h>

#include <algorithm>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

GridBuilder::GridBuilder(const Vec3i& size, const std::array<int, 3>& order, const SparsifyOptions& options,
                         const openvdb::MaskTree* keep)
    : sorter_(size, order, options, keep) {}

void GridBuilder::add_sections(const float* data, int count) {
    const int columns = sorter_.size()[sorter_.order()[0]], rows = sorter_.size()[sorter_.order()[1]],
              sections = sorter_.size()[sorter_.order()[2]];
    const int done = slabs_done_ * slab;
    if (count < 1 || count > sections - done || (count % slab != 0 && count != sections - done))
        throw InvalidInput(
            fmt::format("{} sections handed over after {} of {}", count, std::min(done, sections), sections));
    Strip strip;
    strip.columns = columns;
    strip.row_stride = static_cast<std::size_t>(columns);
    strip.section_stride = strip.row_stride * static_cast<std::size_t>(rows);
    for (int first = 0; first < count; first += slab) {
        std::vector<SortedStrip> strips(static_cast<std::size_t>(sorter_.strips_in_slab()));
        parallel_for(strips.size(), 1, [&](std::size_t i) {
            Strip here = strip;
            const int row = static_cast<int>(i);
            here.floats = data + static_cast<std::size_t>(first) * strip.section_stride +
                          i * leaf::dim * strip.row_stride;
            here.rows = std::min(leaf::dim, rows - row * leaf::dim);
            here.sections = std::min(slab, count - first);
            strips[i] = sorter_.sort(here, slabs_done_, row);
        });
        add_slab(std::move(strips));
    }
}

void GridBuilder::add_slab(std::vector<SortedStrip>&& strips) {
    for (SortedStrip& strip : strips) {
        totals_.add(strip);
        add_blocks(std::move(strip.blocks));
    }
    ++slabs_done_;
}

void GridBuilder::add_blocks(std::vector<SortedBlock>&& blocks) {
    for (SortedBlock& block : blocks) {
        if (block.leaf) {
            leaves_.push_back(block.leaf.get());
            grid_->tree().addLeaf(block.leaf.release());
        } else {
            grid_->tree().addTile(1, block.origin, block.tile_value, block.tile == SortedBlock::Tile::kept);
        }
    }
}

void GridBuilder::fill_background(float background) {
    const bool band = sorter_.options().band.has_value();
    const float high = sorter_.upper_end();
    grid_->tree().root().setBackground(background, false);
    parallel_for(leaves_.size(), 64, [&](std::size_t n) {
        leaf::Leaf& leaf = *leaves_[n];
        if (leaf.isDense()) return;
        float* values = leaf.buffer().data();
        for (auto it = leaf.beginValueOff(); it; ++it)
            if (!band || values[it.pos()] != high) values[it.pos()] = background;
    });
    // Where no leaf was made, internal nodes still hold the background that they were created with.
    std::vector<leaf::LowerNode*> lower_nodes;
    grid_->tree().getNodes(lower_nodes);
    parallel_for(lower_nodes.size(), 1, [&](std::size_t n) {
        for (auto it = lower_nodes[n]->beginValueAll(); it; ++it)  // beginValueOff would visit children too
            if (!it.isValueOn() && (!band || *it != high)) it.setValue(background);
    });
    std::vector<leaf::UpperNode*> upper_nodes;
    grid_->tree().getNodes(upper_nodes);
    for (auto* node : upper_nodes)
        for (auto it = node->beginValueAll(); it; ++it) it.setValue(background);
}

DensityMap GridBuilder::finish(const Frame& frame) {
    if (slabs_done_ != sorter_.slabs())
        throw InvalidInput(fmt::format("{} of {} slabs were handed over", slabs_done_, sorter_.slabs()));
    return finish(frame, totals_);
}

DensityMap GridBuilder::finish(const Frame& frame, MapTotals& totals) {
    if (!grid_) throw InvalidInput("the map was handed out already");
    fill_background(totals.background(sorter_));
    DensityMap map;
    map.grid = std::move(grid_);
    map.grid->setName("density");
    map.grid->setGridClass(openvdb::GRID_UNKNOWN);
    map.frame = frame;
    map.frame.size = sorter_.size();
    map.statistics = totals.statistics();
    store_frame(map);
    return map;
}

}  // namespace vdbgeo
