#include "vdbgeo/stencil/tiles.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <atomic>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/tile_gather.h"

namespace vdbgeo::stencil {
namespace {

using openvdb::CoordBBox;

struct Shape {
    explicit Shape(int h)
        : halo(h),
          planes(BlockLayout::size_x + 2 * h),
          rows(TileGather::rows_of(h)),
          stride(TileGather::stride_of(h)),
          lead(TileGather::lead_of(h)),
          plane(rows * stride),
          guard(2 * lanes) {}
    int halo, planes, rows;
    std::ptrdiff_t stride, lead, plane, guard;
    std::size_t bricks() const {
        return static_cast<std::size_t>(planes * plane + 2 * guard) / BlockField::brick_size + 1;
    }
    /// From an array's memory to its voxel (0, 0, 0).
    std::ptrdiff_t first() const { return guard + halo * plane + halo * stride + lead; }
};

struct Arrays {
    std::vector<BlockField> memory;
    std::vector<RowSpan> spans;
    Tile tile;

    Arrays(const Shape& s, const TileFields& f) {
        const std::size_t count = f.in.size() + 1 + static_cast<std::size_t>(f.scratch) + f.out.size();
        for (std::size_t i = 0; i < count; ++i) {
            memory.emplace_back(s.bricks());
            std::fill_n(memory.back().brick(0), s.bricks() * BlockField::brick_size, 0.0f);
        }
        auto next = memory.begin();
        const auto take = [&] { return (next++)->brick(0) + s.first(); };
        for (std::size_t i = 0; i < f.in.size(); ++i) tile.in.push_back(take());
        tile.active = take();
        for (int i = 0; i < f.scratch; ++i) tile.scratch.push_back(take());
        for (std::size_t i = 0; i < f.out.size(); ++i) tile.out.push_back(take());
        spans.resize(static_cast<std::size_t>(s.planes * s.rows));
        tile.halo = s.halo;
        tile.lead = static_cast<int>(s.lead);
        tile.stride_x = s.plane;
        tile.stride_y = s.stride;
        tile.rows = s.rows;
        tile.spans = spans.data();
    }
};

void run_tile(const BlockLayout& layout, std::int32_t cell, const Shape& s, const TileFields& f,
              const std::function<void(Tile&)>& body, Arrays& a) {
    TileGather gather(layout, {cell, cell + 1}, s.halo);
    Tile& t = a.tile;
    t.cell = static_cast<std::size_t>(cell);
    t.origin = gather.origin();
    const CoordBBox work = layout.work_in(layout.cells()[t.cell]);
    t.work = {work.min() - t.origin, work.max() - t.origin};
    const std::ptrdiff_t corner = s.halo * s.stride + s.lead;
    for (int x = -s.halo; x < BlockLayout::size_x + s.halo; ++x) {
        gather.move_to(t.origin.x() + x);
        const std::ptrdiff_t plane = x * s.plane - corner;
        for (std::size_t i = 0; i < f.in.size(); ++i) gather.copy(f.in[i], 0, t.in[i] + plane);
        gather.activity(1, 0, t.active + plane);
        RowSpan* spans = a.spans.data() + (x + s.halo) * s.rows;
        gather.spans(spans);
        for (int r = 0; r < s.rows; ++r) {
            spans[r].begin =
                static_cast<std::int16_t>(std::max<std::ptrdiff_t>(spans[r].begin - s.lead, -s.halo));
            spans[r].end = static_cast<std::int16_t>(
                std::min<std::ptrdiff_t>(spans[r].end - s.lead, BlockLayout::size_z + s.halo));
        }
    }
    for (float* out : t.out)
        for (int x = 0; x < BlockLayout::size_x; ++x) std::fill_n(out + x * s.plane - corner, s.plane, 0.0f);
    body(t);
    // Whole leaves that are worked on: behind them other boxes' values may lie, which stay.
    for (int x = t.work.min().x() & ~7; x <= (t.work.max().x() | 7); ++x) {
        gather.move_to(t.origin.x() + x);
        for (std::size_t i = 0; i < f.out.size(); ++i)
            gather.scatter(t.out[i] + x * s.plane - corner, f.out[i]);
    }
    kernels().finish_writing();
}

}  // namespace

bool in_sample(const openvdb::Coord& cell, std::size_t every) {
    if (every == 1) return true;
    const auto at = [](int voxel, int size) {
        return static_cast<std::uint64_t>(std::int64_t{voxel} / size);
    };
    const std::uint64_t place = at(cell.x(), BlockLayout::size_x) * 73856093u ^
                                at(cell.y(), BlockLayout::size_y) * 19349663u ^
                                at(cell.z(), BlockLayout::size_z) * 83492791u;
    return place % every == 0;
}

void for_each_tile(const BlockLayout& layout, const TileFields& fields,
                   const std::function<void(Tile&)>& body, const Progress& progress) {
    if (fields.halo < 0 || fields.halo > BlockLayout::max_halo)
        throw InvalidInput("the halo of a tile is too wide");
    const Shape shape(fields.halo);
    tbb::enumerable_thread_specific<Arrays> arrays([&] { return Arrays(shape, fields); });
    std::vector<std::int32_t> cells;
    for (std::size_t i = 0; i < layout.cells().size(); ++i)
        if (layout.cells()[i].own && in_sample(layout.cells()[i].origin, fields.every))
            cells.push_back(static_cast<std::int32_t>(i));
    std::atomic<std::size_t> done{0};
    parallel_for(cells.size(), 1, [&](std::size_t i) {
        run_tile(layout, cells[i], shape, fields, body, arrays.local());
        progress.report(static_cast<double>(++done) / static_cast<double>(cells.size()));
    });
}

}  // namespace vdbgeo::stencil
