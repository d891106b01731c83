#include "converters/map_box.h"

#include <algorithm>

namespace vdbgeo {
namespace {

using openvdb::CoordBBox;

/// Blocks that touch the box along an axis, as far as the map goes.
std::pair<int, int> blocks_along(int axis, const CoordBBox& box, const Vec3i& size) {
    if (box.max()[axis] < 0) return {0, 0};
    const int blocks = (size[axis] - 1) / leaf::dim + 1;
    return {std::max(box.min()[axis], 0) / leaf::dim, std::min(box.max()[axis] / leaf::dim + 1, blocks)};
}

void keep_inside(const CoordBBox& wanted, std::vector<SortedBlock>& blocks) {
    blocks.erase(std::remove_if(blocks.begin(), blocks.end(),
                                [&](const SortedBlock& b) {
                                    return !wanted.hasOverlap(CoordBBox::createCube(b.origin, leaf::dim));
                                }),
                 blocks.end());
}

}  // namespace

void sort_box(MapPasses& passes, const CoordBBox& wanted, GridBuilder& builder, const SeenStrip& seen,
              const Progress& progress) {
    const Vec3i size = passes.sorter().size();
    const auto order = passes.sorter().order();
    const auto rows = blocks_along(order[1], wanted, size), slabs = blocks_along(order[2], wanted, size);
    if (rows.first >= rows.second || slabs.first >= slabs.second) return;
    passes.source().restrict_to({rows.first, rows.second, slabs.first, slabs.second});
    int slab = slabs.first, row = rows.first;
    passes.sort(
        [&](SortedStrip&& strip) {
            keep_inside(wanted, strip.blocks);
            return std::move(strip);
        },
        [&](std::vector<SortedStrip>&& strips) {
            for (SortedStrip& strip : strips) {
                if (seen) seen(slab, row, strip);
                builder.add_blocks(std::move(strip.blocks));
                if (++row == rows.second) row = rows.first, ++slab;
            }
        },
        progress);
}

}  // namespace vdbgeo
