// Hyperdiffusion by a team gives each voxel the bits that it gets in one grid.
#include <gtest/gtest.h>

#include <mutex>
#include <string>
#include <vector>

#include "tests/blocks/noisy_map.h"
#include "tests/blocks/results.h"
#include "tests/support/thread_team.h"
#include "vdbgeo/blocks/partition.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/diffusion_solver.h"
#include "vdbgeo/flow/hyperdiffusion.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

class TeamHyperdiffusion : public ::testing::TestWithParam<test::DiffusionSetting> {};

TEST_P(TeamHyperdiffusion, HasTheBitsOfOneGrid) {
    const FloatGrid::Ptr input = test::noisy_map(), expected = input->deepCopy();
    const HyperdiffusionOptions& options = GetParam().options;
    const HyperdiffusionReport alone = hyperdiffuse(*expected, options);
    for (const auto& parts :
         std::vector<std::pair<int, int>>{{1, 1}, {2, 1}, {1, 2}, {2, 2}, {5, 1}, {6, 3}, {13, 1}}) {
        SCOPED_TRACE(std::to_string(parts.first) + " by " + std::to_string(parts.second));
        const auto boxes = partition(test::noisy_box, parts);
        std::mutex mutex;
        std::uint64_t different = 0, seen = 0;
        test::ThreadTeam(static_cast<int>(boxes.size())).run([&](Team& team) {
            const stencil::Share share{&team, boxes, hyperdiffusion_halo(options)};
            const FloatGrid::Ptr part = part_of(*input, share.with_ghosts(team.rank()));
            const HyperdiffusionReport report = hyperdiffuse(*part, options, {}, &share);
            const std::lock_guard<std::mutex> lock(mutex);
            EXPECT_EQ(report.steps, alone.steps);
            EXPECT_EQ(report.time, alone.time);
            EXPECT_EQ(report.noise, alone.noise);
            EXPECT_EQ(report.removed, alone.removed);
            EXPECT_EQ(report.mean_after, alone.mean_after);
            EXPECT_EQ(report.active_voxels, alone.active_voxels);
            different += test::different(*part, *expected);
            for (auto it = part->cbeginValueOn(); it; ++it) seen += share.own().isInside(it.getCoord());
        });
        EXPECT_EQ(different, 0u);
        EXPECT_EQ(seen, expected->activeVoxelCount());
    }
}

INSTANTIATE_TEST_SUITE_P(Settings, TeamHyperdiffusion, ::testing::ValuesIn(test::diffusion_settings()),
                         test::name_of_setting);

/// Bytes of an exchange: those of the own leaves in the halos of others, for each field.
TEST(TeamHyperdiffusionTraffic, IsWhatTheHalosHold) {
    const FloatGrid::Ptr input = test::noisy_map();
    HyperdiffusionOptions o;
    o.terms = {{1, 1.0}};
    o.steps = 20;
    o.min_cycles = 1;
    o.cycle = 20;
    const auto boxes = partition(test::noisy_box, {3, 1});
    std::mutex mutex;
    test::ThreadTeam(3).run([&](Team& team) {
        const stencil::Share share{&team, boxes, hyperdiffusion_halo(o)};
        const FloatGrid::Ptr part = part_of(*input, share.with_ghosts(team.rank()));
        std::uint64_t leaves = 0;
        for (int r = 0; r < 3; ++r)
            for (auto it = input->tree().cbeginLeaf(); it; ++it)
                leaves += r != team.rank() && share.own().isInside(it->origin()) &&
                          share.with_ghosts(r).hasOverlap(it->getNodeBoundingBox());
        const HyperdiffusionReport report = hyperdiffuse(*part, o, {}, &share);
        // The diffusivity; u and its predecessor after each sweep of four steps, u alone after the last.
        const std::lock_guard<std::mutex> lock(mutex);
        EXPECT_EQ(report.bytes_sent, leaves * 2048 * (1 + 4 * 2 + 1));
        EXPECT_GT(leaves, 0u);
    });
}

TEST(TeamHyperdiffusionErrors, AreToldByAll) {
    const FloatGrid::Ptr input = test::noisy_map();
    const auto boxes = partition(test::noisy_box, {2, 1});
    HyperdiffusionOptions o;
    o.steps = 3;
    const auto run = [&](int halo, const HyperdiffusionOptions& options, const FloatGrid& grid) {
        test::ThreadTeam(2).run([&](Team& team) {
            const stencil::Share share{&team, boxes, halo};
            hyperdiffuse(*part_of(grid, share.with_ghosts(team.rank())), options, {}, &share);
        });
    };
    EXPECT_THROW(run(0, o, *input), InvalidInput);
    HyperdiffusionOptions adi = o;
    adi.stepper = Stepper::adi;
    EXPECT_THROW(run(8, adi, *input), InvalidInput);
    // One voxel that is no number, in one part: both refuse.
    const FloatGrid::Ptr odd = input->deepCopy();
    odd->tree().setValueOn(Coord(30, 70, 70), std::nanf(""));
    EXPECT_THROW(run(8, o, *odd), InvalidInput);
    // Nothing at all is nothing to do.
    EXPECT_NO_THROW(run(8, o, *test::empty_grid()));
}

}  // namespace
}  // namespace vdbgeo
