#include "vdbgeo/stencil/block_layout.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "tests/stencil/bricks.h"
#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using stencil::BlockField;
using stencil::BlockLayout;

int floored(int a, int b) { return static_cast<int>(std::floor(static_cast<double>(a) / b)); }

Coord cell_origin(const Coord& c) {
    return {floored(c.x(), 32) * 32, floored(c.y(), 32) * 32,
            floored(c.z(), BlockLayout::size_z) * BlockLayout::size_z};
}

class LayoutOf : public testing::TestWithParam<std::string> {};

TEST_P(LayoutOf, HasEachActiveVoxelOnce) {
    const auto grid = test::sparse_grid(GetParam(), 3);
    const BlockLayout layout(grid->tree());
    EXPECT_EQ(layout.active_count(), grid->activeVoxelCount());
    const auto accessor = grid->getConstAccessor();
    std::set<Coord> origins;
    std::uint64_t active = 0;
    for (std::size_t b = 0; b < layout.brick_count(); ++b) {
        EXPECT_TRUE(origins.insert(layout.origin(b)).second);
        int on = 0;
        for (int k = 0; k < 512; ++k) {
            on += test::is_active(layout, b, k);
            ASSERT_EQ(test::is_active(layout, b, k), accessor.isValueOn(test::voxel_of(layout, b, k)));
        }
        EXPECT_GT(on, 0);
        EXPECT_EQ(layout.full(b), on == 512);
        active += static_cast<std::uint64_t>(on);
    }
    EXPECT_EQ(active, grid->activeVoxelCount());
}

TEST_P(LayoutOf, PutsLeavesIntoCellsAndCellsIntoOrder) {
    const auto grid = test::sparse_grid(GetParam(), 3);
    const BlockLayout layout(grid->tree());
    std::size_t held = 0, cells = 0, bricks = 0;
    std::int32_t brick_before = -1;
    for (const auto& slab : layout.slabs()) {
        EXPECT_EQ(slab.first_cell, cells);
        EXPECT_EQ(slab.begin, bricks);
        for (std::size_t i = slab.first_cell; i < slab.last_cell; ++i) {
            const BlockLayout::Cell& cell = layout.cells()[i];
            EXPECT_EQ(cell.origin, cell_origin(cell.origin));
            EXPECT_EQ(cell.origin.y(), layout.cells()[slab.first_cell].origin.y());
            if (i > 0) {
                const Coord& a = layout.cells()[i - 1].origin;
                EXPECT_LT(std::make_tuple(a.y(), a.z(), a.x()),
                          std::make_tuple(cell.origin.y(), cell.origin.z(), cell.origin.x()));
            }
            for (int x = 0; x < 4; ++x)
                for (int y = 0; y < 4; ++y)
                    for (int z = 0; z < BlockLayout::leaves_z; ++z) {
                        const std::int32_t b =
                            cell.bricks[static_cast<std::size_t>((x * 4 + y) * BlockLayout::leaves_z + z)];
                        if (b == BlockLayout::none) continue;
                        EXPECT_EQ(b, brick_before + 1) << "bricks lie in the order in which they are swept";
                        brick_before = b;
                        EXPECT_EQ(layout.origin(static_cast<std::size_t>(b)),
                                  cell.origin.offsetBy(8 * x, 8 * y, 8 * z));
                        EXPECT_LT(static_cast<std::size_t>(b), slab.end);
                        ++held;
                    }
        }
        cells = slab.last_cell;
        bricks = slab.end;
    }
    EXPECT_EQ(held, layout.brick_count());
    EXPECT_EQ(cells, layout.cells().size());
    EXPECT_EQ(bricks, layout.brick_count());
}

TEST_P(LayoutOf, KnowsTheNeighboursOfItsCells) {
    const auto grid = test::sparse_grid(GetParam(), 3);
    const BlockLayout layout(grid->tree());
    for (const BlockLayout::Cell& cell : layout.cells())
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    const Coord at = cell.origin.offsetBy(32 * x, 32 * y, BlockLayout::size_z * z);
                    const BlockLayout::Cell* expected = nullptr;
                    for (const BlockLayout::Cell& other : layout.cells())
                        if (other.origin == at) expected = &other;
                    EXPECT_EQ(layout.neighbor(cell, x, y, z), expected);
                }
}

TEST_P(LayoutOf, CutsSlabsIntoRunsOfNeighbours) {
    const auto grid = test::sparse_grid(GetParam(), 3);
    const BlockLayout layout(grid->tree());
    for (const int length : {1, 2, 4, 100})
        for (const auto& slab : layout.slabs()) {
            auto next = static_cast<std::int32_t>(slab.first_cell);
            for (const BlockLayout::Run& run : layout.runs(slab, length)) {
                EXPECT_EQ(run.first, next);
                EXPECT_LT(run.first, run.last);
                EXPECT_LE(run.last - run.first, length);
                for (std::int32_t i = run.first + 1; i < run.last; ++i)
                    EXPECT_EQ(layout.cells()[static_cast<std::size_t>(i)].origin,
                              layout.cells()[static_cast<std::size_t>(i - 1)].origin.offsetBy(32, 0, 0));
                next = run.last;
            }
            EXPECT_EQ(next, static_cast<std::int32_t>(slab.last_cell));
        }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
    std::string out = info.param;
    std::replace(out.begin(), out.end(), ' ', '_');
    return out;
}

INSTANTIATE_TEST_SUITE_P(Masks, LayoutOf, testing::ValuesIn(test::sparse_kinds()), name_of);

TEST(BlockLayout, OfAnEmptyTreeIsEmpty) {
    const auto grid = test::empty_grid();
    EXPECT_EQ(BlockLayout(grid->tree()).brick_count(), 0u);
    grid->tree().touchLeaf(Coord(3));  // a leaf without active voxels
    const BlockLayout layout(grid->tree());
    EXPECT_EQ(layout.brick_count(), 0u);
    EXPECT_EQ(layout.active_count(), 0u);
    EXPECT_TRUE(layout.cells().empty());
    EXPECT_TRUE(layout.slabs().empty());
}

TEST(BlockLayout, RefusesActiveTiles) {
    const auto grid = test::empty_grid();
    grid->tree().addTile(1, Coord(0), 1.0f, true);
    EXPECT_THROW(BlockLayout(grid->tree()), InvalidInput);
    grid->tree().voxelizeActiveTiles();
    EXPECT_EQ(BlockLayout(grid->tree()).active_count(), 512u);
}

TEST(BlockField, LoadsAndStoresActiveVoxelsOnly) {
    const auto grid = test::sparse_grid("cells", 4);
    const BlockLayout layout(grid->tree());
    BlockField field(layout.brick_count());
    stencil::load(layout, grid->tree(), 0.25f, field.brick(0));
    const auto accessor = grid->getConstAccessor();
    for (std::size_t b = 0; b < layout.brick_count(); ++b)
        for (int k = 0; k < 512; ++k)
            ASSERT_EQ(field.brick(b)[k], test::is_active(layout, b, k)
                                             ? accessor.getValue(test::voxel_of(layout, b, k)) - 0.25f
                                             : 0.0f);
    const auto copy = grid->deepCopy();
    for (auto it = copy->beginValueOn(); it; ++it) it.setValue(99);
    stencil::store(layout, field.brick(0), 0, copy->tree());
    EXPECT_TRUE(test::inactive_untouched(*copy));
    const auto changed = copy->getConstAccessor();
    for (auto it = grid->cbeginValueOn(); it; ++it) ASSERT_EQ(changed.getValue(it.getCoord()), *it - 0.25f);
}

TEST(BlockField, SummaryIsThatOfTheActiveVoxels) {
    const auto grid = test::sparse_grid("cells", 4);
    auto accessor = grid->getAccessor();
    const Coord odd = grid->cbeginValueOn().getCoord();
    accessor.setValueOn(odd, std::numeric_limits<float>::infinity());
    const BlockLayout layout(grid->tree());
    BlockField field(layout.brick_count()), shifted(layout.brick_count());
    stencil::load(layout, grid->tree(), 0, field.brick(0));
    const stencil::FieldSummary s = stencil::summarize(layout, field.brick(0));
    double sum = 0, squares = 0, low = 1e30, high = -1e30;
    for (auto it = grid->cbeginValueOn(); it; ++it) {
        if (it.getCoord() == odd) continue;
        sum += *it;
        squares += static_cast<double>(*it) * *it;
        low = std::min<double>(low, *it);
        high = std::max<double>(high, *it);
    }
    EXPECT_EQ(s.count, grid->activeVoxelCount() - 1);
    EXPECT_EQ(s.non_finite, 1u);
    EXPECT_NEAR(s.sum, sum, 1e-9);
    EXPECT_NEAR(s.sum_of_squares, squares, 1e-9);
    EXPECT_EQ(s.min, static_cast<float>(low));
    EXPECT_EQ(s.max, static_cast<float>(high));
    accessor.setValueOn(odd, 0.0f);
    stencil::load(layout, grid->tree(), 0, field.brick(0));
    stencil::load(layout, grid->tree(), 0.5f, shifted.brick(0));
    EXPECT_NEAR(stencil::squared_distance(layout, field.brick(0), shifted.brick(0)),
                0.25 * static_cast<double>(layout.active_count()), 1e-3);
}

TEST(BlockField, SummaryOfNothingIsZero) {
    const BlockLayout layout(test::empty_grid()->tree());
    const stencil::FieldSummary s = stencil::summarize(layout, nullptr);
    EXPECT_EQ(s.count, 0u);
    EXPECT_EQ(s.mean(), 0);
    EXPECT_EQ(s.variance(), 0);
    EXPECT_EQ(s.min, 0);
    EXPECT_EQ(s.max, 0);
}

}  // namespace
}  // namespace vdbgeo
