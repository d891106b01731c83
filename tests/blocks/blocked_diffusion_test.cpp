// Diffusion in blocks, with the values in files between cycles, gives each voxel the bits that it gets in one
// grid in memory.
#include "vdbgeo/blocks/blocked_diffusion.h"

#include <gtest/gtest.h>

#include "tests/blocks/noisy_map.h"
#include "tests/blocks/results.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

MapSource source_of(const FloatGrid& grid) {
    return {grid.evalActiveVoxelBoundingBox(), grid.constTransformPtr(),
            [&grid](const CoordBBox& box) { return part_of(grid, box); }};
}

struct Shape {
    const char* name;
    std::optional<Coord> size;
    std::optional<int> steps;
    std::uint64_t memory;
};

class BlockedHyperdiffusion : public ::testing::TestWithParam<test::DiffusionSetting> {
 protected:
    /// By blocks of these shapes.
    static void expect_same_bits(const FloatGrid& input, const std::vector<Shape>& shapes) {
        const test::TempFolder folder;
        const FloatGrid::Ptr expected = input.deepCopy();
        const HyperdiffusionReport alone = hyperdiffuse(*expected, GetParam().options);
        for (const Shape& shape : shapes) {
            SCOPED_TRACE(shape.name);
            HyperdiffusionReport report;
            const BlockOptions options{shape.memory, folder.path(), shape.size, shape.steps, {}};
            std::unique_ptr<BlockedDiffusion> solver;
            ASSERT_NO_THROW(solver =
                                hyperdiffuse_blocks(source_of(input), GetParam().options, options, report));
            ASSERT_TRUE(solver);
            EXPECT_GT(solver->most_blocks(), shape.name == std::string("large") ? 0u : 1u);
            const FloatGrid::Ptr made = test::stored(*solver, input, report);
            EXPECT_EQ(report.steps, alone.steps);
            EXPECT_EQ(report.time, alone.time);
            EXPECT_EQ(report.noise, alone.noise);
            EXPECT_EQ(report.removed, alone.removed);
            EXPECT_EQ(report.mean_before, alone.mean_before);
            EXPECT_EQ(report.mean_after, alone.mean_after);
            EXPECT_EQ(report.active_voxels, alone.active_voxels);
            EXPECT_EQ(expected->activeVoxelCount(), made->activeVoxelCount());
            EXPECT_EQ(test::different(*expected, *made), 0u);
        }
        EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
    }
};

TEST_P(BlockedHyperdiffusion, HasTheBitsOfOneGrid) {
    std::vector<Shape> shapes{{"by memory", {}, {}, 24000000}};
    if (GetParam().options.steps)  // the automatic time takes a hundred
        shapes.insert(shapes.end(), {{"pencils", Coord(128, 64, 128), 8, 0},
                                     {"slabs of few steps", Coord(128, 32, 512), 4, 0},
                                     {"large", {}, {}, 2000000000}});
    expect_same_bits(*test::noisy_map(), shapes);
}

TEST_P(BlockedHyperdiffusion, OfSingleCellsToo) {
    expect_same_bits(*test::noisy_map(CoordBBox(Coord(0, -10, 20), Coord(60, 70, 150))),
                     {{"cells", Coord(32, 32, 128), {}, 0}});
}

INSTANTIATE_TEST_SUITE_P(Settings, BlockedHyperdiffusion, ::testing::ValuesIn(test::diffusion_settings()),
                         test::name_of_setting);

TEST(BlockedHighPass, HasTheBitsOfOneGrid) {
    const FloatGrid::Ptr input = test::noisy_map(CoordBBox(Coord(0, -10, 20), Coord(70, 90, 150)));
    const test::TempFolder folder;
    HighPassOptions options;
    options.slow = 0.1;
    options.time = 2;
    for (const int order : {0, 1}) {
        options.order = order;
        const FloatGrid::Ptr expected = input->deepCopy();
        const HyperdiffusionReport alone = coupled_high_pass(*expected, options);
        for (const std::optional<int> steps : {std::optional<int>(), std::optional<int>(8)}) {
            HyperdiffusionReport report;
            const auto solver = coupled_high_pass_blocks(
                source_of(*input), options, {0, folder.path(), Coord(64, 64, 128), steps, {}}, report);
            ASSERT_TRUE(solver);
            EXPECT_EQ(report.mean_after, alone.mean_after);
            EXPECT_EQ(test::different(*expected, *test::stored(*solver, *input, report)), 0u);
            EXPECT_EQ(report.removed, alone.removed);
        }
    }
}

TEST(BlockedHyperdiffusionErrors, AreThoseOfOneGrid) {
    const FloatGrid::Ptr input = test::noisy_map();
    const test::TempFolder folder;
    HyperdiffusionOptions o;
    o.steps = 3;
    HyperdiffusionReport report;
    const BlockOptions blocks{0, folder.path(), Coord(64, 64, 128), {}, {}};
    HyperdiffusionOptions adi = o;
    adi.stepper = Stepper::adi;
    EXPECT_THROW(hyperdiffuse_blocks(source_of(*input), adi, blocks, report), InvalidInput);
    EXPECT_THROW(hyperdiffuse_blocks(source_of(*input), o, {1000, folder.path(), {}, {}, {}}, report),
                 NumericalError);
    EXPECT_THROW(
        hyperdiffuse_blocks(source_of(*input), o, {0, "/not/there", Coord(64, 64, 128), {}, {}}, report),
        IoError);
    input->tree().setValueOn(Coord(30, 70, 70), std::nanf(""));
    EXPECT_THROW(hyperdiffuse_blocks(source_of(*input), o, blocks, report), InvalidInput);
    const FloatGrid::Ptr empty = test::empty_grid();
    MapSource nothing = source_of(*empty);
    nothing.box = CoordBBox(Coord(0), Coord(63));
    EXPECT_FALSE(hyperdiffuse_blocks(nothing, o, blocks, report));
}

TEST(BlockPlan, FitsIntoTheMemoryAndCoversTheMap) {
    BlockWork work;
    work.steps = 40;
    work.steps_a_sweep = 4;
    work.reach = 2;
    work.first_reach = 3;
    work.bytes_a_brick = 3 * 2048;
    const CoordBBox box(Coord(0), Coord(1289));
    for (const double gigabytes : {0.5, 2.0, 8.0, 64.0}) {
        const BlockPlan plan = plan_blocks(box, work, static_cast<std::uint64_t>(gigabytes * 1e9));
        double voxels = 0;
        for (const CoordBBox& block : plan.blocks) {
            CoordBBox with_ghosts = block;
            with_ghosts.expand(plan.halo);
            with_ghosts.intersect(CoordBBox(Coord(0), Coord(1311, 1311, 1407)));
            EXPECT_LE(double(with_ghosts.volume()) / 512 * work.bytes_a_brick, gigabytes * 1e9);
            voxels += double(block.volume());
        }
        EXPECT_EQ(voxels, 1312.0 * 1312 * 1408);
        EXPECT_GE(plan.halo, plan.steps * work.reach + work.first_reach);
        EXPECT_EQ(plan.blocks.size() == 1, gigabytes > 60);
    }
}

}  // namespace
}  // namespace vdbgeo
