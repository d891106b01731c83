#include "converters/leaf_source.h"

#include <tbb/task_arena.h>

#include <mutex>

#include "converters/mrc_sink.h"
#include "converters/streamed_grid.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

/// The slab that is being asked for.
struct Slab {
    std::mutex mutex;
    int number = 0;
    FloatGrid::Ptr grid;
};

/// As the sorted strips of a map file have it.
SortedBlock block_of(const LeafSource::Found& found, const Coord& corner, float background) {
    SortedBlock block;
    block.origin = corner;
    if (found.leaf) {
        block.leaf = std::make_unique<leaf::Leaf>(*found.leaf);
        float* values = block.leaf->buffer().data();
        for (auto it = block.leaf->beginValueOff(); it; ++it)
            if (values[it.pos()] == background) values[it.pos()] = StripSorter::unknown_background;
    } else {
        block.tile = found.on ? SortedBlock::Tile::kept : SortedBlock::Tile::above;
        block.tile_value = found.tile;
    }
    return block;
}

SortedStrip strip_at(const LeafSource& map, int slab, int row) {
    const LeafSource::Finder find = map.finder();
    SortedStrip strip;
    for (int x = 0; x < map.frame.size.x(); x += leaf::dim) {
        const Coord corner(x, row * leaf::dim, slab * leaf::dim);
        const LeafSource::Found found = find(corner);
        if (found.leaf || found.on || found.tile != map.background)
            strip.blocks.push_back(block_of(found, corner, map.background));
    }
    return strip;
}

}  // namespace

std::function<LeafSource::Finder()> slab_finder(int axis, const CoordBBox& box,
                                                std::function<FloatGrid::Ptr(const CoordBBox&)> read) {
    const auto slab = std::make_shared<Slab>();
    const auto slab_at = [=](const Coord& corner) {
        const std::lock_guard<std::mutex> lock(slab->mutex);
        if (!slab->grid || slab->number != corner[axis]) {
            CoordBBox wanted = box;
            wanted.min()[axis] = corner[axis];
            wanted.max()[axis] = corner[axis] + leaf::dim - 1;
            slab->grid.reset();  // first, so that there never are two
            // Apart from the loop that asks: a thread that waits in `read` must not come back here.
            tbb::this_task_arena::isolate([&] { slab->grid = read(wanted); });
            slab->number = corner[axis];
        }
        return slab->grid;
    };
    return [=]() -> LeafSource::Finder {
        struct Held {
            FloatGrid::Ptr grid;
            std::unique_ptr<FloatGrid::ConstUnsafeAccessor> accessor;
        };
        const auto held = std::make_shared<Held>();
        return [=](const Coord& corner) {
            const FloatGrid::Ptr grid = slab_at(corner);
            if (grid != held->grid) {
                held->accessor = std::make_unique<FloatGrid::ConstUnsafeAccessor>(grid->constTree());
                held->grid = grid;
            }
            LeafSource::Found found;
            found.leaf = held->accessor->probeConstLeaf(corner);
            if (!found.leaf) found.on = held->accessor->probeValue(corner, found.tile);
            return found;
        };
    };
}

MrcWriteReport write_mrc(const LeafSource& map, const std::filesystem::path& path,
                         const MrcWriteOptions& options, const Progress& progress) {
    const auto lookup = [&map]() -> LeafLookup {
        return [find = map.finder()](const Coord& corner, float& tile) -> const float* {
            const LeafSource::Found found = find(corner);
            tile = found.tile;
            return found.leaf ? found.leaf->buffer().data() : nullptr;
        };
    };
    return write_mrc_from(
        map.meta, map.frame, map.active_box, path, options,
        [&](const MrcBox& box, const std::array<int, 3>& order) {
            return DenseSections(lookup, box.first, box.frame.size, order);
        },
        progress);
}

void write_vdb(const LeafSource& map, const std::filesystem::path& path, const VdbWriteOptions& options,
               std::uint64_t memory, const std::filesystem::path& scratch, const Progress& progress) {
    SparsifyOptions any_value;  // inactive values may be any: as with a band
    any_value.threshold = 0.0f;
    any_value.band = 1.0f;
    const StripSorter sorter(map.frame.size, {0, 1, 2}, any_value);
    const auto leaves = std::make_shared<PackedLeaves>(sorter, options, memory, scratch);
    for (int slab = 0; slab < sorter.slabs(); ++slab) {
        std::vector<std::shared_ptr<const PackedLeaves::Row>> rows(
            static_cast<std::size_t>(sorter.strips_in_slab()));
        map.finder()(Coord(0, 0, slab * leaf::dim));  // has the slab read, by all threads
        parallel_for(rows.size(), 1, [&](std::size_t row) {
            rows[row] = leaves->pack(strip_at(map, slab, static_cast<int>(row)));
        });
        leaves->add_slab(rows);
        progress.part(0, 0.6).report(double(slab + 1) / sorter.slabs());
    }
    const auto grid = std::make_shared<StreamedGrid>(leaves, map.background);
    static_cast<openvdb::MetaMap&>(*grid) = map.meta;
    if (map.finish_meta) map.finish_meta(*grid);
    // Shared: a copy of a transform rounds its scale.
    grid->setTransform(std::const_pointer_cast<openvdb::math::Transform>(map.transform));
    vdbgeo::write_vdb({grid}, path, options, progress.part(0.6, 1));
}

}  // namespace vdbgeo
