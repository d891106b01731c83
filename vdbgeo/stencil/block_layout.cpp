#include "vdbgeo/stencil/block_layout.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <limits>
#include <tuple>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/brick_sums.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo::stencil {
namespace {

using leaf::Leaf;
using openvdb::Coord;
using openvdb::CoordBBox;

/// Arithmetic shifts round to minus infinity: cells of negative coordinates come out right.
constexpr int shift_x = 5, shift_y = 5, shift_z = 7;
static_assert(BlockLayout::size_x == 1 << shift_x && BlockLayout::size_z == 1 << shift_z);

Coord cell_of(const Coord& o) { return {o.x() >> shift_x, o.y() >> shift_y, o.z() >> shift_z}; }

auto cell_key(const Coord& c) { return std::make_tuple(c.y(), c.z(), c.x()); }

auto leaf_key(const Coord& o) {
    const Coord c = cell_of(o);
    return std::make_tuple(c.y(), c.z(), c.x(), o.x(), o.y(), o.z());
}

std::size_t slot_in_cell(const Coord& o) {
    const int x = (o.x() >> 3) & (BlockLayout::leaves_x - 1), y = (o.y() >> 3) & (BlockLayout::leaves_y - 1),
              z = (o.z() >> 3) & (BlockLayout::leaves_z - 1);
    return static_cast<std::size_t>((x * BlockLayout::leaves_y + y) * BlockLayout::leaves_z + z);
}

}  // namespace

BlockLayout::BlockLayout(const openvdb::FloatTree& tree, const std::optional<CoordBBox>& own) {
    if (tree.hasActiveTiles()) throw InvalidInput("the grid has active tiles where leaves are needed");
    std::vector<const Leaf*> leaves;
    tree.getNodes(leaves);
    leaves.erase(std::remove_if(leaves.begin(), leaves.end(), [](const Leaf* l) { return l->isEmpty(); }),
                 leaves.end());
    tbb::parallel_sort(leaves.begin(), leaves.end(), [](const Leaf* a, const Leaf* b) {
        return leaf_key(a->origin()) < leaf_key(b->origin());
    });
    take(leaves.size(), own, [&](std::size_t i) {
        LeafMask leaf{leaves[i]->origin(), {}};
        for (openvdb::Index w = 0; w < 8; ++w)
            leaf.mask[w] = leaves[i]->getValueMask().getWord<std::uint64_t>(w);
        return leaf;
    });
}

BlockLayout::BlockLayout(std::vector<LeafMask> leaves, const std::optional<CoordBBox>& own) {
    leaves.erase(
        std::remove_if(leaves.begin(), leaves.end(), [](const LeafMask& l) { return l.mask == Mask{}; }),
        leaves.end());
    tbb::parallel_sort(leaves.begin(), leaves.end(), [](const LeafMask& a, const LeafMask& b) {
        return leaf_key(a.origin) < leaf_key(b.origin);
    });
    take(leaves.size(), own, [&](std::size_t i) { return leaves[i]; });
}

/// Leaves come in their order.
template <class LeafAt>
void BlockLayout::take(std::size_t leaves, const std::optional<CoordBBox>& own, const LeafAt& leaf_at) {
    if (leaves > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
        throw InvalidInput("the grid has more than 2^31 leaves");
    origins_.resize(leaves);
    masks_.resize(leaves);
    full_.resize(leaves);
    parallel_for(leaves, 512, [&](std::size_t i) {
        const LeafMask leaf = leaf_at(i);
        origins_[i] = leaf.origin;
        masks_[i] = leaf.mask;
        full_[i] = std::all_of(leaf.mask.begin(), leaf.mask.end(), [](std::uint64_t w) { return ~w == 0; });
    });
    make_cells();
    make_neighbors();
    if (own) work_on(*own);
}

void BlockLayout::work_on(const CoordBBox& box) {
    work_ = box;
    for (Cell& cell : cells_) cell.own = !work_in(cell).empty();
}

std::uint64_t BlockLayout::active_count() const {
    struct Count {
        std::uint64_t voxels = 0;
        void add(const Count& other) { voxels += other.voxels; }
    };
    return sum_of_bricks<Count>(*this,
                                [&](std::size_t brick, Count& count) {
                                    for (const std::uint64_t word : masks_[brick])
                                        count.voxels +=
                                            static_cast<std::uint64_t>(__builtin_popcountll(word));
                                })
        .voxels;
}

void BlockLayout::make_cells() {
    for (std::size_t i = 0; i < origins_.size(); ++i) {
        const Coord c = cell_of(origins_[i]);
        const Coord first(c.x() * size_x, c.y() * size_y, c.z() * size_z);
        if (cells_.empty() || cells_.back().origin != first) {
            if (cells_.empty() || cells_.back().origin.y() != first.y())
                slabs_.push_back({i, i, cells_.size(), cells_.size()});
            cells_.push_back({first, {}, {}, true});
            cells_.back().bricks.fill(none);
            ++slabs_.back().last_cell;
        }
        cells_.back().bricks[slot_in_cell(origins_[i])] = static_cast<std::int32_t>(i);
        slabs_.back().end = i + 1;
    }
}

void BlockLayout::make_neighbors() {
    parallel_for(cells_.size(), 16, [&](std::size_t i) {
        Cell& cell = cells_[i];
        std::size_t n = 0;
        for (int dx = -1; dx <= 1; ++dx)
            for (int dy = -1; dy <= 1; ++dy)
                for (int dz = -1; dz <= 1; ++dz, ++n) {
                    const Coord o = cell.origin.offsetBy(dx * size_x, dy * size_y, dz * size_z);
                    const auto it = std::lower_bound(
                        cells_.begin(), cells_.end(), o,
                        [](const Cell& c, const Coord& at) { return cell_key(c.origin) < cell_key(at); });
                    const bool found = it != cells_.end() && it->origin == o;
                    cell.neighbors[n] = found ? static_cast<std::int32_t>(it - cells_.begin()) : none;
                }
    });
}

std::vector<BlockLayout::Run> BlockLayout::runs(const Slab& slab, int length) const {
    std::vector<Run> out;
    for (std::size_t i = slab.first_cell; i < slab.last_cell; ++i) {
        if (!cells_[i].own) continue;
        const Coord& o = cells_[i].origin;
        const bool goes_on = !out.empty() && i > slab.first_cell && cells_[i - 1].own &&
                             cells_[i - 1].origin == o.offsetBy(-size_x, 0, 0) &&
                             (o.x() / size_x) % length != 0 && out.back().last - out.back().first < length;
        if (goes_on)
            ++out.back().last;
        else
            out.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(i + 1)});
    }
    return out;
}

std::size_t BlockLayout::memory() const {
    return origins_.capacity() * sizeof(Coord) + masks_.capacity() * sizeof(Mask) + full_.capacity() +
           cells_.capacity() * sizeof(Cell) + slabs_.capacity() * sizeof(Slab);
}

}  // namespace vdbgeo::stencil
