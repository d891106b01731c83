#include "vdbgeo/stencil/tiles.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <set>

#include "tests/stencil/bricks.h"
#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using stencil::BlockField;
using stencil::BlockLayout;
using stencil::Tile;

class TilesOf : public testing::TestWithParam<std::string> {};

TEST_P(TilesOf, HoldWhatTheGridHolds) {
    const auto grid = test::sparse_grid(GetParam(), 11);
    const BlockLayout layout(grid->tree());
    BlockField field(layout.brick_count()), negative(layout.brick_count());
    stencil::load(layout, grid->tree(), 0, field.brick(0));
    for (std::size_t i = 0; i < layout.brick_count() * 512; ++i) negative.brick(0)[i] = -field.brick(0)[i];
    for (const int halo : {0, 1, 2, 7, 8, 9, 16}) {
        SCOPED_TRACE(halo);
        std::atomic<int> wrong{0}, tiles{0};
        std::mutex lock;
        std::set<Coord> seen;
        stencil::for_each_tile(layout, {{field.brick(0), negative.brick(0)}, {}, halo, 0}, [&](Tile& t) {
            const auto accessor = grid->getConstUnsafeAccessor();
            int bad = t.halo != halo;
            for (int x = -halo; x < 32 + halo; ++x)
                for (int y = -halo; y < 32 + halo; ++y) {
                    const stencil::RowSpan span = t.span(x, y);
                    for (int z = -halo; z < BlockLayout::size_z + halo; ++z) {
                        const Coord c = t.origin.offsetBy(x, y, z);
                        const bool on = accessor.isValueOn(c);
                        const float v = on ? accessor.getValue(c) : 0.0f;
                        bad += t.in[0][t.at(x, y, z)] != v || t.in[1][t.at(x, y, z)] != -v;
                        bad += t.active[t.at(x, y, z)] != (on ? 1.0f : 0.0f);
                        bad += on && (z < span.begin || z >= span.end);
                    }
                    bad += span.begin < span.end &&
                           (span.begin < -halo || span.end > BlockLayout::size_z + halo);
                }
            wrong += bad;
            ++tiles;
            const std::lock_guard<std::mutex> guard(lock);
            seen.insert(t.origin);
        });
        EXPECT_EQ(wrong, 0);
        EXPECT_EQ(static_cast<std::size_t>(tiles), layout.cells().size());
        EXPECT_EQ(seen.size(), layout.cells().size());
    }
}

TEST_P(TilesOf, WriteBackTheirOwnVoxels) {
    const auto grid = test::sparse_grid(GetParam(), 12);
    const BlockLayout layout(grid->tree());
    BlockField field(layout.brick_count()), sum(layout.brick_count()), copy(layout.brick_count());
    stencil::load(layout, grid->tree(), 0, field.brick(0));
    // Σ over the six neighbours, by way of a scratch array.
    stencil::for_each_tile(layout, {{field.brick(0)}, {sum.brick(0), copy.brick(0)}, 1, 1}, [&](Tile& t) {
        for (int x = -1; x < 33; ++x)
            for (int y = -1; y < 33; ++y)
                for (int z = -1; z < BlockLayout::size_z + 1; ++z)
                    t.scratch[0][t.at(x, y, z)] = t.in[0][t.at(x, y, z)];
        for (int x = 0; x < 32; ++x)
            for (int y = 0; y < 32; ++y)
                for (int z = 0; z < BlockLayout::size_z; ++z) {
                    EXPECT_EQ(t.out[0][t.at(x, y, z)], 0.0f);
                    if (t.active[t.at(x, y, z)] == 0) continue;
                    const float* s = t.scratch[0] + t.at(x, y, z);
                    t.out[0][t.at(x, y, z)] =
                        (s[t.stride_x] + s[-t.stride_x]) + (s[t.stride_y] + s[-t.stride_y]) + (s[1] + s[-1]);
                    t.out[1][t.at(x, y, z)] = *s;
                }
    });
    const auto accessor = grid->getConstAccessor();
    const auto at = [&](const Coord& c, int x, int y, int z) {
        const Coord n = c.offsetBy(x, y, z);
        return accessor.isValueOn(n) ? accessor.getValue(n) : 0.0f;
    };
    for (std::size_t b = 0; b < layout.brick_count(); ++b)
        for (int k = 0; k < 512; ++k) {
            const Coord c = test::voxel_of(layout, b, k);
            const bool on = accessor.isValueOn(c);
            ASSERT_EQ(copy.brick(b)[k], on ? accessor.getValue(c) : 0.0f);
            ASSERT_EQ(sum.brick(b)[k], on ? (at(c, 1, 0, 0) + at(c, -1, 0, 0)) +
                                                (at(c, 0, 1, 0) + at(c, 0, -1, 0)) +
                                                (at(c, 0, 0, 1) + at(c, 0, 0, -1))
                                          : 0.0f);
        }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
    std::string out = info.param;
    std::replace(out.begin(), out.end(), ' ', '_');
    return out;
}

INSTANTIATE_TEST_SUITE_P(Masks, TilesOf, testing::ValuesIn(test::sparse_kinds()), name_of);

TEST(Tiles, WiderThanACellAreRefused) {
    const BlockLayout layout(test::sparse_grid("one voxel", 1)->tree());
    const auto nothing = [](Tile&) {};
    EXPECT_THROW(stencil::for_each_tile(layout, {{}, {}, 33, 0}, nothing), InvalidInput);
    EXPECT_THROW(stencil::for_each_tile(layout, {{}, {}, -1, 0}, nothing), InvalidInput);
    EXPECT_NO_THROW(stencil::for_each_tile(layout, {{}, {}, 32, 0}, nothing));
}

TEST(Tiles, StopWhenTheyAreToldTo) {
    const BlockLayout layout(test::sparse_grid("cells", 1)->tree());
    const Progress stop([](double) { return false; });
    EXPECT_THROW(stencil::for_each_tile(
                     layout, {{}, {}, 1, 0}, [](Tile&) {}, stop),
                 Cancelled);
}

TEST(Tiles, KeepTheErrorOfTheirBody) {
    const BlockLayout layout(test::sparse_grid("cells", 1)->tree());
    EXPECT_THROW(stencil::for_each_tile(layout, {{}, {}, 1, 0}, [](Tile&) { throw NumericalError("x"); }),
                 NumericalError);
}

}  // namespace
}  // namespace vdbgeo
