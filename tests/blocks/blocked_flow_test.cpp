// A geometric flow in blocks, and one by a team, give each voxel the bits that it gets in one grid.
#include "vdbgeo/blocks/blocked_flow.h"

#include <gtest/gtest.h>

#include <mutex>

#include "tests/blocks/noisy_map.h"
#include "tests/blocks/results.h"
#include "tests/support/temp_folder.h"
#include "tests/support/thread_team.h"
#include "vdbgeo/blocks/partition.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

/// Three by two cells along y and z, two along x.
const CoordBBox box(Coord(0, -10, 20), Coord(60, 70, 150));

struct Setting {
    const char* name;
    GeometricFlowOptions options;
};

std::vector<Setting> settings() {
    std::vector<Setting> all{{"q0", {}}, {"q1, fidelity", {}}, {"pressure", {}}, {"dt", {}}, {"q7", {}}};
    for (Setting& s : all) s.options.time = 0.6;
    all[1].options.order = 1;
    all[1].options.fidelity = 0.3;
    all[1].options.time = 0.03;
    all[2].options.pressure = -0.2;
    all[3].options.dt = 0.05;
    all[3].options.scale = 4;
    all[4].options.order = 7;
    all[4].options.time = 1e-9;
    return all;
}

void expect_same(const HyperdiffusionReport& expected, const HyperdiffusionReport& given) {
    EXPECT_EQ(expected.steps, given.steps);
    EXPECT_EQ(expected.time, given.time);
    EXPECT_EQ(expected.dt, given.dt);
    EXPECT_EQ(expected.removed, given.removed);
    EXPECT_EQ(expected.mean_after, given.mean_after);
    EXPECT_EQ(expected.active_voxels, given.active_voxels);
}

TEST(BlockedFlow, HasTheBitsOfOneGrid) {
    const FloatGrid::Ptr input = test::noisy_map(box);
    const test::TempFolder folder;
    for (const Setting& setting : settings()) {
        SCOPED_TRACE(setting.name);
        const FloatGrid::Ptr expected = input->deepCopy();
        const HyperdiffusionReport alone = geometric_flow(*expected, setting.options);
        ASSERT_GT(alone.steps, 1);
        EXPECT_GT(test::different(*expected, *input), 1000u);
        const MapSource source{box, input->constTransformPtr(),
                               [&](const CoordBBox& wanted) { return part_of(*input, wanted); }};
        for (const Coord& size : {Coord(32, 32, 128), Coord(64, 64, 128), Coord(64, 32, 256)}) {
            HyperdiffusionReport report;
            const auto flow =
                geometric_flow_blocks(source, setting.options, {0, folder.path(), size, {}, {}}, report);
            ASSERT_TRUE(flow);
            EXPECT_GT(report.blocks, 1u);
            EXPECT_EQ(test::different(*expected, *test::stored(*flow, *input, report)), 0u);
            expect_same(alone, report);
        }
    }
}

TEST(TeamFlow, HasTheBitsOfOneGrid) {
    const FloatGrid::Ptr input = test::noisy_map(box);
    for (const Setting& setting : settings()) {
        SCOPED_TRACE(setting.name);
        const FloatGrid::Ptr expected = input->deepCopy();
        const HyperdiffusionReport alone = geometric_flow(*expected, setting.options);
        for (const auto& parts : {std::pair(2, 1), std::pair(3, 2)}) {
            const auto boxes = partition(box, parts);
            std::mutex mutex;
            test::ThreadTeam(static_cast<int>(boxes.size())).run([&](Team& team) {
                const stencil::Share share{&team, boxes, geometric_flow_halo(setting.options)};
                const FloatGrid::Ptr part = part_of(*input, share.with_ghosts(team.rank()));
                const HyperdiffusionReport report = geometric_flow(*part, setting.options, {}, &share);
                const std::lock_guard<std::mutex> lock(mutex);
                expect_same(alone, report);
                EXPECT_GT(report.bytes_sent, 0u);
                EXPECT_EQ(test::different(*part, *expected, share.own()), 0u);
            });
        }
    }
}

TEST(BlockedFlowErrors, AreThoseOfOneGrid) {
    const FloatGrid::Ptr input = test::noisy_map(box);
    const test::TempFolder folder;
    const MapSource source{box, input->constTransformPtr(),
                           [&](const CoordBBox& wanted) { return part_of(*input, wanted); }};
    GeometricFlowOptions o;
    HyperdiffusionReport report;
    o.dt = 10;
    EXPECT_THROW(geometric_flow_blocks(source, o, {0, folder.path(), Coord(64, 64, 128), {}, {}}, report),
                 InvalidInput);
    o.dt.reset();
    EXPECT_THROW(geometric_flow_blocks(source, o, {1000, folder.path(), {}, {}, {}}, report), NumericalError);
    input->tree().setValueOn(Coord(30, 50, 70), std::nanf(""));
    EXPECT_THROW(geometric_flow_blocks(source, o, {0, folder.path(), Coord(64, 64, 128), {}, {}}, report),
                 InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
