// A diffusion that was stopped goes on from its checkpoint, whoever has the parts, and ends with the bits of
// one that was not.
#include "vdbgeo/flow/checkpoint.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>

#include "tests/blocks/noisy_map.h"
#include "tests/blocks/results.h"
#include "tests/support/temp_folder.h"
#include "tests/support/thread_team.h"
#include "vdbgeo/blocks/blocked_diffusion.h"
#include "vdbgeo/blocks/partition.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

/// Four by two cells along y and z.
const CoordBBox box(Coord(0, -10, 20), Coord(60, 90, 150));

/// What a run made, in a grid of its own.
struct Made {
    FloatGrid::Ptr grid;
    HyperdiffusionReport report;
};

using Run = std::function<Made(const HyperdiffusionOptions&, const CheckpointOptions&)>;

const FloatGrid& input() {
    static const FloatGrid::Ptr map = test::noisy_map(box);
    return *map;
}

Made in_memory(const HyperdiffusionOptions& options, const CheckpointOptions& checkpoint) {
    Made made{input().deepCopy(), {}};
    made.report = hyperdiffuse(*made.grid, options, {}, nullptr, checkpoint);
    return made;
}

Run by_team(std::pair<int, int> parts) {
    return [parts](const HyperdiffusionOptions& options, const CheckpointOptions& checkpoint) {
        const auto boxes = partition(box, parts);
        Made made{input().deepCopy(), {}};
        std::mutex mutex;
        test::ThreadTeam(static_cast<int>(boxes.size())).run([&](Team& team) {
            const stencil::Share share{&team, boxes, hyperdiffusion_halo(options)};
            const FloatGrid::Ptr part = part_of(input(), share.with_ghosts(team.rank()));
            const HyperdiffusionReport report = hyperdiffuse(*part, options, {}, &share, checkpoint);
            const std::lock_guard<std::mutex> lock(mutex);
            made.report = report;
            test::put_in(*part, share.own(), *made.grid);
        });
        return made;
    };
}

Run in_blocks(const Coord& size) {
    return [size](const HyperdiffusionOptions& options, const CheckpointOptions& checkpoint) {
        const test::TempFolder scratch;
        const MapSource source{box, input().constTransformPtr(),
                               [](const CoordBBox& wanted) { return part_of(input(), wanted); }};
        Made made;
        BlockOptions blocks{0, scratch.path(), size, {}, {}};
        blocks.checkpoint = checkpoint;
        const auto solver = hyperdiffuse_blocks(source, options, blocks, made.report);
        made.grid = test::stored(*solver, input(), made.report);
        return made;
    };
}

void expect_same(const Made& expected, const Made& made) {
    EXPECT_EQ(made.report.steps, expected.report.steps);
    EXPECT_EQ(made.report.cycles, expected.report.cycles);
    EXPECT_EQ(made.report.time, expected.report.time);
    EXPECT_EQ(made.report.removed, expected.report.removed);
    EXPECT_EQ(made.report.mean_after, expected.report.mean_after);
    EXPECT_EQ(test::different(*expected.grid, *made.grid), 0u);
}

HyperdiffusionOptions fixed_steps() {
    HyperdiffusionOptions o;
    o.steps = 30;
    o.cycle = 6;
    return o;
}

/// Until the noise is gone, going back once it went too far.
HyperdiffusionOptions automatic() {
    HyperdiffusionOptions o;
    o.terms = {{0, 1.0}};
    o.sigma = EdgeScale::parse("local");
    return o;
}

/// To be stopped once so many cycles are done, and no more often.
CheckpointOptions stopping(const fs::path& folder, int cycles, int members = 1) {
    CheckpointOptions c;
    c.folder = folder;
    c.every = 2;
    c.resume = true;
    const auto asked = std::make_shared<std::atomic<int>>(0);
    c.stop = [asked, cycles, members] { return ++*asked > (cycles - 1) * members; };
    return c;
}

struct Way {
    const char* name;
    Run run;
    int members;
};

std::vector<Way> ways() {
    return {{"memory", in_memory, 1},
            {"team of 2", by_team({2, 1}), 2},
            {"team of 6", by_team({3, 2}), 6},
            {"cells", in_blocks({32, 32, 128}), 1},
            {"pencils", in_blocks({64, 64, 128}), 1}};
}

TEST(Checkpoint, IsGoneOnFromByAnyone) {
    for (const HyperdiffusionOptions& options : {fixed_steps(), automatic()}) {
        const Made expected = in_memory(options, {});
        ASSERT_GE(expected.report.cycles, 3);
        const test::TempFolder folder;
        // Each takes one or two cycles and hands on to the next.
        int done = 0;
        for (const Way& way : ways()) {
            SCOPED_TRACE(way.name);
            CheckpointOptions c = stopping(folder / "c", 1, way.members);
            EXPECT_THROW(way.run(options, c), Cancelled);
            EXPECT_TRUE(fs::exists(folder / "c" / (++done % 2 ? "b" : "a") / "list"));
            if (done + 1 >= expected.report.cycles) break;
        }
        for (const Way& way : ways()) {
            SCOPED_TRACE(way.name);
            CheckpointOptions c;
            c.folder = folder / "c";
            c.resume = true;
            c.every = 1000;
            const Made made = way.run(options, c);
            EXPECT_EQ(made.report.resumed_cycles, done);
            expect_same(expected, made);
        }
        remove_checkpoints(folder / "c");
        EXPECT_FALSE(fs::exists(folder / "c"));
    }
}

TEST(Checkpoint, FallsBackWhereTheNewestIsTorn) {
    const HyperdiffusionOptions options = fixed_steps();
    const Made expected = in_memory(options, {});
    const auto tear = [](const fs::path& file, auto&& how) {
        std::string bytes = test::read_bytes(file);
        how(bytes);
        test::write_bytes(file, bytes);
    };
    const std::vector<std::pair<const char*, std::function<void(std::string&)>>> faults{
        {"cut short", [](std::string& b) { b.resize(b.size() / 2); }},
        {"a bit turned", [](std::string& b) { b[b.size() / 3] = static_cast<char>(b[b.size() / 3] ^ 4); }},
        {"empty", [](std::string& b) { b.clear(); }}};
    for (const char* file : {"state_0001", "list"})
        for (const auto& [fault, how] : faults) {
            SCOPED_TRACE(std::string(file) + " " + fault);
            const test::TempFolder folder;
            CheckpointOptions c = stopping(folder.path(), 4, 2);
            EXPECT_THROW(by_team({2, 1})(options, c), Cancelled);  // after 2 and 4 cycles: b, then a
            tear(folder / "a" / file, how);
            c.stop = {};
            const Made made = in_memory(options, c);
            EXPECT_EQ(made.report.resumed_cycles, 2);
            expect_same(expected, made);
        }
    const test::TempFolder folder;
    CheckpointOptions c = stopping(folder.path(), 4, 1);
    EXPECT_THROW(in_memory(options, c), Cancelled);
    for (const char* generation : {"a", "b"}) fs::remove(folder / generation / "state_0000");
    c.stop = {};
    const Made made = in_memory(options, c);
    EXPECT_EQ(made.report.resumed_cycles, 0);
    expect_same(expected, made);
}

TEST(Checkpoint, OfSomethingElseIsRefused) {
    const test::TempFolder folder;
    CheckpointOptions c = stopping(folder.path(), 2);
    EXPECT_THROW(in_memory(fixed_steps(), c), Cancelled);
    c.stop = {};
    HyperdiffusionOptions other = fixed_steps();
    other.steps = 31;
    EXPECT_THROW(in_memory(other, c), InvalidInput);
    const FloatGrid::Ptr changed = input().deepCopy();
    changed->tree().setValueOn(Coord(30, 70, 70), 10.001f);
    EXPECT_THROW(hyperdiffuse(*changed, fixed_steps(), {}, nullptr, c), InvalidInput);
    c.resume = false;  // then it is anew, and the old one goes
    EXPECT_EQ(in_memory(other, c).report.resumed_cycles, 0);
    c.resume = true;
    EXPECT_GT(in_memory(other, c).report.resumed_cycles, 0);
}

TEST(Checkpoint, FolderThatCannotBeWritten) {
    CheckpointOptions c;
    c.folder = "/proc/none";
    EXPECT_THROW(in_memory(fixed_steps(), c), IoError);
}

}  // namespace
}  // namespace vdbgeo
