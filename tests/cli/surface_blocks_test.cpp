// Surfaces of maps that are gone through in blocks: the bytes of those of maps in memory.
#include <cmath>
#include <fstream>

#include "converters/map_file.h"
#include "converters/map_parts.h"
#include "tests/cli/cli_test.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/pack.h"
#include "vdbgeo/surface/level_set.h"

using namespace vdbgeo::test;
using openvdb::Coord;

namespace {

namespace fs = std::filesystem;

/// Smooth waves in noise, 100 × 90 × 300: at 0.3 a surface of two million triangles, which does not fit.
class SurfaceBlocks : public Cli {
 protected:
    void SetUp() override {
        MrcBytes map;
        map.size = {100, 90, 300};
        map.voxel = {1.5, 1.5, 1.5};
        map.values = {0};  // written below
        std::string bytes = map.header();
        std::uint64_t state = 1;
        std::vector<float> section(100 * 90);
        for (int z = 0; z < 300; ++z) {
            for (int i = 0; i < 9000; ++i) {
                state = state * 6364136223846793005u + 1442695040888963407u;
                section[static_cast<std::size_t>(i)] =
                    static_cast<float>(std::sin(0.3 * (i % 100)) * std::sin(0.2 * (i / 100)) +
                                       std::cos(0.25 * z) + double(state >> 40) * 0x1p-24);
            }
            bytes.append(reinterpret_cast<const char*>(section.data()), 4 * section.size());
        }
        make("a.mrc", bytes);
    }

    /// The surface by 64 MB, in more than one block, and whole.
    void expect_same(const std::string& in, Words how) {
        SCOPED_TRACE(in + " " + joined(how));
        how.insert(how.begin(), {"surface", in, "OUT"});
        how[2] = at("whole.ply");
        const Json whole = json(how);
        how[2] = at("blocks.ply");
        how.insert(how.end(), {"--memory", "64M"});
        const Json blocks = json(how);
        EXPECT_TRUE(bytes("blocks.ply") == bytes("whole.ply"));
        EXPECT_GT(blocks.value("blocks", 0), 1);
        for (const char* key : {"vertices", "faces", "iso", "iso_rule", "method"})
            EXPECT_EQ(blocks[key], whole[key]) << key;
        for (const char* stage : {"count", "write"}) EXPECT_TRUE(blocks["seconds"].contains(stage)) << stage;
        fs::remove(at("whole.ply"));
        fs::remove(at("blocks.ply"));
    }
};

}  // namespace

TEST_F(SurfaceBlocks, HaveTheBytesOfTheWhole) {
    const std::string map = at("a.mrc");
    expect_same(map, {"--iso", "0.3"});
    expect_same(map, {"--iso", "0.5sigma"});
    expect_same(map, {"--iso", "0.3", "-j", "1"});
    expect_same(map, {"--threshold", "0.1sigma", "--iso", "0.9"});
    expect_same(map, {"--threshold", "40%", "--iso", "0.5", "--halo", "1"});
    expect_same(map, {"--iso", "-0.3", "--invert", "--crop", "3:97,:,11:"});
    make("packed.mrc", gzip(bytes("a.mrc")));
    expect_same(at("packed.mrc"), {"--iso", "0.3", "--scratch", folder_.path().string()});
}

TEST_F(SurfaceBlocks, OfGridsAndParts) {
    const std::string map = at("a.mrc");
    good({"convert", map, at("a.vdb"), "--threshold", "0", "--quiet"});
    expect_same(at("a.vdb"), {"--iso", "0.3"});
    good({"convert", map, at("band.vdb"), "--threshold", "0.3", "--band", "0.4", "--quiet"});
    expect_same(at("band.vdb"), {"--iso", "0.3"});
    const vdbgeo::DensityMap whole = vdbgeo::read_map(map).map;
    fs::create_directory(at("a.parts"));
    vdbgeo::write_map_part(whole, {Coord(0), Coord(103, 63, 303)}, 0, at("a.parts"));
    vdbgeo::write_map_part(whole, {Coord(0, 64, 0), Coord(103, 95, 303)}, 1, at("a.parts"));
    expect_same(at("a.parts"), {"--iso", "0.3"});
    expect_same(at("a.parts"), {"--iso", "1sigma"});
}

TEST_F(SurfaceBlocks, OfLevelSets) {
    const vdbgeo::DensityMap whole = vdbgeo::read_map(at("a.mrc")).map;
    vdbgeo::write_vdb({vdbgeo::level_set(whole, 0.3)}, at("ls.vdb"));
    expect_same(at("ls.vdb"), {});
}

TEST_F(SurfaceBlocks, WhatFitsIsDoneWhole) {
    const std::string map = phantom("small.mrc", 40);
    const Json whole = json({"surface", map, at("a.ply"), "--iso", "1"}),
               within = json({"surface", map, at("b.ply"), "--iso", "1", "--memory", "512M"});
    EXPECT_TRUE(bytes("a.ply") == bytes("b.ply"));
    EXPECT_FALSE(within.contains("blocks"));
    EXPECT_EQ(within["area_A2"], whole["area_A2"]);
    EXPECT_EQ(within["volume_A3"], whole["volume_A3"]);
    for (const Words& how :
         {Words{"--iso", "otsu"}, {"--cap"}, {"--method", "dual"}, {"--keep-largest", "1"}}) {
        Words a{"surface", map, at("a.stl")}, b{"surface", map, at("b.stl"), "--memory", "512M"};
        a.insert(a.end(), how.begin(), how.end());
        b.insert(b.end(), how.begin(), how.end());
        good(a);
        good(b);
        EXPECT_TRUE(bytes("a.stl") == bytes("b.stl")) << joined(how);
    }
}

TEST_F(SurfaceBlocks, WhatCannotBeDoneInBlocksIsRefused) {
    const std::string map = at("a.mrc");
    const auto before = listing();
    const auto expect = [&](Words how, int code, const std::string& subject, const std::string& text) {
        Words words{"surface", map, at("b.ply"), "--memory", "64M", "--quiet"};
        words.insert(words.end(), how.begin(), how.end());
        SCOPED_TRACE(joined(how));
        expect_error(vdbgeo(words), code, subject, text);
        EXPECT_EQ(listing(), before);
    };
    expect({"--iso", "otsu"}, 2, "--iso otsu", "a number of sigmas");
    expect({"--iso", "volume:1000"}, 2, "--iso volume:1000", "--memory");
    expect({"--iso", "0.3", "--cap"}, 5, map, "without --cap");
    expect({"--iso", "0.3", "--method", "delaunay"}, 5, map, "--bin 2");
    expect({"--iso", "0.3", "--min-area", "10"}, 5, map, "--memory");
    expect({"--iso", "0.3", "--split"}, 5, map, "--memory");
    expect({"--labels", "all"}, 5, map, "--memory");
    expect({"--iso", "99"}, 5, map, "no surface at the isovalue 99");
    expect({"--iso", "0.3", "--despeckle", "9"}, 2, "despeckling", "threshold");
    expect({"--iso", "0.3", "--memory", "1M"}, 2, "--memory", "");
    Words stl{"surface", map, at("b.stl"), "--iso", "0.3", "--memory", "64M", "--quiet"};
    expect_error(vdbgeo(stl), 2, at("b.stl"), ".ply");
    stl[2] = at("none/b.ply");
    expect_error(vdbgeo(stl), 4, at("none/b.ply"));
    EXPECT_EQ(listing(), before);
}

TEST_F(SurfaceBlocks, AFailureLeavesNothing) {
    const Words words{"surface", at("a.mrc"), at("b.ply"), "--iso", "0.3", "--memory", "64M"};
    const auto before = listing();
    RunOptions interrupt;
    interrupt.signal = SIGINT;
    interrupt.signal_at = "counting";  // its line comes when it ends
    const Ended r = vdbgeo(words, interrupt);
    EXPECT_EQ(r.code, 130) << r.err;
    EXPECT_EQ(listing(), before);
    RunOptions killed;
    killed.signal_at = "counting";
    EXPECT_EQ(vdbgeo(words, killed).killed, SIGKILL);
    EXPECT_EQ(listing(), before);
    RunOptions small;
    small.limits = {{RLIMIT_FSIZE, 1 << 20}};
    EXPECT_EQ(vdbgeo(words, small).code, 4);
    EXPECT_EQ(listing(), before);
    fs::create_symlink("/dev/full", at("b.ply"));
    EXPECT_EQ(vdbgeo(words).code, 4);
}
