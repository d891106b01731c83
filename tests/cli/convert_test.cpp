// Files into each other: what comes back is what went in.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>

#include "tests/cli/cli_test.h"
#include "tests/support/data.h"
#include "tests/support/mrc_bytes.h"

using namespace vdbgeo::test;

namespace {

/// What lies behind the header and its extension.
std::string data_of(const std::string& map, bool big_endian = false) {
    std::uint32_t extended = 0;
    std::memcpy(&extended, map.data() + 4 * 23, 4);
    if (big_endian) extended = __builtin_bswap32(extended);
    return map.substr(1024 + extended);
}

/// Each sample's bytes the other way round.
std::string turned(std::string data, std::size_t sample) {
    for (std::size_t i = 0; i + sample <= data.size(); i += sample)
        std::reverse(data.begin() + static_cast<std::ptrdiff_t>(i),
                     data.begin() + static_cast<std::ptrdiff_t>(i + sample));
    return data;
}

struct RealMap {
    const char* file;
    std::size_t sample;  // bytes
    bool big_endian = false;
};

const std::vector<RealMap> real_maps{
    {"pyto/labels.mrc", 1},
    {"sfftk/tiny1.map", 1},
    {"sfftk/test_data_multi0.map", 1},
    {"pyto/layers.mrc", 2},
    {"pyto/big_head.mrc", 2},
    {"visfd/test_image_membrane.rec", 2},
    {"rosettasciio/HAADFscan.mrc", 2},
    {"mrcfile_jl/emd_3197_f16.mrc", 2},
    {"sfftk/emd_1832.map", 4},
    {"npc2018/C8_Gle1.mrc", 4},
    {"mrcfile/EMD-3001.map", 4},
    {"moorhen/low-res-emd-32143.map", 4},
    {"cctbx/ccp4_20_21_22_to_30_40_50.ccp4", 4},
    {"cctbx/tst_input.map", 4},
    {"gemmi/5i55_tiny.ccp4", 4},
    {"pymol_open_source/map.ccp4", 4, true},
    {"pyto/swapped_byte_order.mrc", 4, true},
};

class Convert : public Cli {
 protected:
    /// Map → grid → map.
    std::string there_and_back(const std::string& map) {
        good({"convert", map, at("there.vdb"), "--quiet"});
        good({"convert", at("there.vdb"), at("back.mrc"), "--quiet"});
        return bytes("back.mrc");
    }
};
class RealRoundTrip : public Convert, public testing::WithParamInterface<RealMap> {};

float bits(std::uint32_t word) {
    float value;
    std::memcpy(&value, &word, 4);
    return value;
}

}  // namespace

INSTANTIATE_TEST_SUITE_P(Maps, RealRoundTrip, testing::ValuesIn(real_maps), [](const auto& map) {
    std::string name = map.param.file;
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
});

TEST_P(RealRoundTrip, GivesTheDataBack) {
    const RealMap& real = GetParam();
    VDBGEO_NEEDS_DATA(real.file);
    const std::string path = (data_folder() / real.file).string();
    std::string expected = data_of(read_bytes(path), real.big_endian);
    if (real.big_endian) expected = turned(expected, real.sample);
    const std::string found = data_of(there_and_back(path));
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_TRUE(found == expected);
    // The frame comes back too, to the digits of a header.
    const Json before = json({"info", path}), after = json({"info", at("back.mrc")});
    for (const char* key : {"nx", "ny", "nz", "mode", "axis_order"})
        EXPECT_EQ(after[key], before[key]) << key;
    for (const char* key : {"voxel_size_A", "origin_A"})
        for (std::size_t a = 0; a < 3; ++a) {
            const double value = before[key][a];
            EXPECT_NEAR(after[key][a], value, 1e-5 * (1 + std::abs(value))) << key;
        }
    EXPECT_EQ(after["warnings"], Json::array()) << after["warnings"].dump();
}

TEST_F(Convert, FloatsOfEveryKindComeBack) {
    MrcBytes map;
    map.size = {5, 3, 2};
    map.axes = {3, 1, 2};
    for (std::uint32_t i = 0; i < 30; ++i) map.values.push_back(bits(0x3f800000 + 12345 * i));
    const std::vector<std::uint32_t> odd{0x80000000, 0x00000001, 0x807fffff, 0x7f800000, 0xff800000,
                                         0x7fc00000, 0xffc01234, 0x7f7fffff, 0x00800000};
    std::string data = map.data();
    std::memcpy(data.data() + 8, odd.data(), 4 * odd.size());
    const std::string back = there_and_back(make("a.mrc", map.header() + data));
    EXPECT_TRUE(data_of(back) == data);
}

TEST_F(Convert, SamplesOfEveryModeComeBack) {
    for (const int mode : {0, 1, 6, 12, 101}) {
        SCOPED_TRACE(mode);
        MrcBytes map;
        map.mode = mode;
        map.size = {mode == 101 ? 7 : 256, mode == 0 || mode == 101 ? 4 : 256, 2};
        map.values.assign(static_cast<std::size_t>(map.size[0] * map.size[1] * map.size[2]), 0);
        std::string data = map.data();  // of the right length; then every sample there is
        for (std::size_t i = 0; i < data.size(); ++i)
            data[i] = static_cast<char>(mode == 0 ? i : i % 2 ? i >> 9 : i >> 1);
        if (mode == 101)  // the last nibble of an odd row is nothing
            for (std::size_t i = 0; i < data.size(); ++i)
                data[i] = static_cast<char>(i % 4 == 3 ? i & 15 : 37 * i);
        const std::string back = there_and_back(make("a.mrc", map.header() + data));
        EXPECT_TRUE(data_of(back) == data);
        EXPECT_EQ(json({"info", at("back.mrc")})["mode"], mode);
    }
}

TEST_F(Convert, UnsignedBytesStayUnsigned) {
    MrcBytes map;
    map.mode = 0;
    map.size = {256, 1, 1};
    for (int i = 0; i < 256; ++i) map.values.push_back(i);
    const std::string path = make("a.mrc", map.str());
    good({"convert", path, at("a.vdb"), "--mode0", "unsigned"});
    good({"convert", at("a.vdb"), at("b.mrc")});
    EXPECT_TRUE(data_of(bytes("b.mrc")) == map.data());
    EXPECT_EQ(json({"info", at("b.mrc")})["max"], 255.0);
}

TEST_F(Convert, BigEndianMapsHaveTheSameNumbers) {
    MrcBytes little, big;
    little.size = big.size = {6, 5, 4};
    big.big_endian = true;
    EXPECT_TRUE(there_and_back(make("a.mrc", big.str())).substr(1024) == little.data());
}

TEST_F(Convert, ModeThatCannotHoldTheValuesIsRefused) {
    MrcBytes map;
    map.values.assign(24, 0.5);
    const std::string in = make("a.mrc", map.str()), out = make("b.mrc", "as it was");
    expect_error(vdbgeo({"convert", in, out, "--mode", "0", "--quiet"}), 3, out + ": ",
                 "does not fit into mode 0");
    EXPECT_EQ(bytes("b.mrc"), "as it was");
}

TEST_F(Convert, GridsIntoGrids) {
    const std::string map = phantom("a.mrc", 24, {"--snr", "1"});
    good({"convert", map, at("a.vdb"), "--threshold", "0"});
    good({"convert", at("a.vdb"), at("b.vdb"), "--compression", "zip"});
    good({"convert", at("b.vdb"), at("c.vdb"), "--compression", "none"});
    Json a = json({"info", at("a.vdb")}), c = json({"info", at("c.vdb")});
    EXPECT_GT(a["active_voxels"], 0);
    EXPECT_LT(a["active_voxels"], 24 * 24 * 24);
    for (const char* key : {"active_voxels", "background", "class", "transform", "min", "max", "mean", "rms"})
        EXPECT_EQ(a[key], c[key]) << key;
    good({"convert", at("a.vdb"), at("a2.mrc")});
    good({"convert", at("c.vdb"), at("c2.mrc")});
    EXPECT_TRUE(data_of(bytes("a2.mrc")) == data_of(bytes("c2.mrc")));
}

TEST_F(Convert, HalfFloatsAreNear) {
    const std::string map = phantom("a.mrc", 24);
    good({"convert", map, at("a.vdb")});
    good({"convert", map, at("h.vdb"), "--half", "--compression", "none"});
    const Json a = json({"info", at("a.vdb")}), h = json({"info", at("h.vdb")});
    EXPECT_EQ(a["active_voxels"], h["active_voxels"]);
    good({"convert", at("h.vdb"), at("h.mrc")});
    const Json from_half = json({"info", at("h.mrc")});
    for (const char* key : {"min", "max", "mean"}) {
        const double value = a[key];
        EXPECT_NEAR(from_half[key], value, 1e-3 * std::abs(value)) << key;
        EXPECT_NE(from_half[key], a[key]) << key;
    }
}

TEST_F(Convert, MeshesIntoMeshes) {
    const std::string map = phantom("a.mrc", 24, {}, "torus");
    const Json first = json({"surface", map, at("a.ply"), "--iso", "0"});
    EXPECT_EQ(first["genus"], 1);
    std::string last = "a.ply";
    for (const char* next : {"b.obj", "c.off", "d.stl", "e.ply"}) {
        good({"convert", at(last), at(next)});
        const Json j = json({"measure", at(next)});
        for (const char* key : {"vertices", "faces", "components", "genus", "closed", "boundary_edges"})
            EXPECT_EQ(j[key], first[key]) << next << ": " << key;
        for (const char* key : {"area_A2", "volume_A3"})
            EXPECT_NEAR(j[key], first[key], 1e-9 * first[key].get<double>()) << next << ": " << key;
        last = next;
    }
}

TEST_F(Convert, OntoItself) {
    const std::string map = phantom("a.mrc", 16), before = bytes("a.mrc");
    good({"convert", map, map});
    EXPECT_TRUE(data_of(bytes("a.mrc")) == data_of(before));
    good({"convert", map, at("a.vdb")});
    good({"convert", at("a.vdb"), at("a.vdb"), "--compression", "zip"});
    EXPECT_EQ(json({"info", at("a.vdb")})["active_voxels"], 16 * 16 * 16);
    good({"surface", map, at("a.stl"), "--iso", "0"});
    const std::string mesh = bytes("a.stl");
    good({"convert", at("a.stl"), at("a.stl")});
    EXPECT_TRUE(bytes("a.stl") == mesh);
}

TEST_F(Convert, TheSmallProgramsDoTheSame) {
    const std::string map = phantom("a.mrc", 24);
    const Ended there = run({MRC2VDB_PROGRAM, map, at("b.vdb"), "--quiet"});
    const Ended back = run({VDB2MRC_PROGRAM, at("b.vdb"), at("b.mrc"), "--quiet"});
    for (const Ended& r : {there, back}) {
        EXPECT_EQ(r.code, 0) << r.err;
        EXPECT_EQ(r.out + r.err, "");
    }
    good({"convert", map, at("c.vdb"), "--quiet"});
    good({"convert", at("c.vdb"), at("c.mrc"), "--quiet"});
    EXPECT_TRUE(bytes("b.vdb") == bytes("c.vdb"));
    EXPECT_TRUE(bytes("b.mrc") == bytes("c.mrc"));
    EXPECT_TRUE(data_of(bytes("b.mrc")) == data_of(bytes("a.mrc")));
}

TEST_F(Convert, ScalingIsStatedInTheResultAndInALabel) {
    const std::string map = phantom("a.mrc", 24);
    const Json j = json({"convert", map, at("b.mrc"), "--mode", "1", "--scale", "auto"});
    const double factor = j["scaling"]["factor"], offset = j["scaling"]["offset"],
                 error = j["scaling"]["largest_error"];
    EXPECT_GT(factor, 0);
    EXPECT_GT(error, 0);
    EXPECT_LE(error, 0.5 * factor * (1 + 1e-9));
    const Json before = json({"info", map}), after = json({"info", at("b.mrc")});
    EXPECT_EQ(after["min"], -32768);
    EXPECT_EQ(after["max"], 32767);
    EXPECT_NEAR(factor * after["mean"].get<double>() + offset, before["mean"], error);
    std::string label;
    for (const Json& l : after["labels"])
        if (l.get<std::string>().rfind("vdbgeo: density = ", 0) == 0) label = l;
    double f = 0, o = 0;
    ASSERT_EQ(std::sscanf(label.c_str(), "vdbgeo: density = %lf * stored + %lf", &f, &o), 2) << label;
    EXPECT_EQ(f, factor);
    EXPECT_EQ(o, offset);
    EXPECT_NE(good({"convert", map, at("b.mrc"), "--mode", "1", "--scale", "auto"}).out.find("largest error"),
              std::string::npos);
    const Json given = json({"convert", map, at("b.mrc"), "--mode", "6", "--scale", "0.01,-500"});
    EXPECT_EQ(given["scaling"]["factor"], 0.01);
    EXPECT_EQ(given["scaling"]["offset"], -500);
    const Json halves = json({"convert", map, at("b.mrc"), "--mode", "12"});
    EXPECT_EQ(halves["scaling"]["factor"], 1);
    EXPECT_GT(halves["scaling"]["largest_error"], 0);
    EXPECT_EQ(json({"convert", map, at("b.mrc")})["scaling"]["largest_error"], 0);
}

TEST_F(Convert, CompressedMapsHoldThePlainOnes) {
    const std::string map = phantom("a.mrc", 40);
    good({"convert", map, at("a.vdb")});
    good({"convert", at("a.vdb"), at("b.mrc")});
    good({"convert", at("a.vdb"), at("b.mrc.gz")});
    good({"convert", map, at("c.map"), "--compress", "gz"});
    EXPECT_TRUE(bytes("b.mrc.gz") == bytes("c.map"));
    EXPECT_EQ(run({"/bin/sh", "-c", "gzip -dc < " + at("b.mrc.gz") + " | cmp - " + at("b.mrc")}).code, 0);
    good({"convert", at("b.mrc.gz"), at("d.mrc")});
    EXPECT_TRUE(bytes("d.mrc") == bytes("b.mrc"));
    RunOptions pipe;
    pipe.output = at("e.mrc.gz");
    good({"convert", at("a.vdb"), "-", "--compress", "gz", "--mode", "1", "--scale", "auto"}, pipe);
    good({"convert", at("a.vdb"), at("f.mrc.gz"), "--mode", "1", "--scale", "auto"});
    EXPECT_TRUE(bytes("e.mrc.gz") == bytes("f.mrc.gz")) << "statistics first or last";
}

TEST_F(Convert, AGridIsWrittenTheSameWhetherItIsLoadedOrNot) {
    const std::string map = phantom("a.mrc", 40);
    good({"convert", map, at("a.vdb"), "--threshold", "1sigma"});
    good({"convert", at("a.vdb"), at("streamed.mrc")});
    // A flag that has no meaning for a grid, and is warned of, makes it be loaded.
    good({"convert", at("a.vdb"), at("loaded.mrc"), "--voxel-size", "3"});
    EXPECT_TRUE(bytes("streamed.mrc") == bytes("loaded.mrc"));
}

TEST_F(Convert, AGridIsWrittenInLessMemoryThanItTakesToLoadIt) {
    if (sanitized) GTEST_SKIP() << "memory is not told under a sanitizer";
    good({"convert", phantom("a.mrc", 280), at("a.vdb")});  // 88 MB
    EXPECT_GT(good({"convert", at("a.vdb"), at("loaded.mrc"), "--quiet", "--voxel-size", "3"}).peak_bytes,
              110'000'000u);
    EXPECT_LT(good({"convert", at("a.vdb"), at("streamed.mrc"), "--quiet"}).peak_bytes, 80'000'000u);
    EXPECT_TRUE(bytes("streamed.mrc") == bytes("loaded.mrc"));
}

TEST_F(Convert, AFlippedByteInAGridIsRefusedOrHarmless) {
    const std::string map = phantom("a.mrc", 24);
    good({"convert", map, at("a.vdb")});
    good({"convert", at("a.vdb"), at("good.mrc")});
    const std::string grid = bytes("a.vdb");
    for (std::size_t i = 0; i < 40; ++i) {
        std::string flipped = grid;
        flipped[i < 10 ? 9 * i : i * 7919 % grid.size()] ^= static_cast<char>(1 << i % 8);
        const Ended r = vdbgeo({"convert", make("b.vdb", flipped), at("b.mrc"), "--quiet"});
        if (r.code == 0) {
            EXPECT_TRUE(bytes("b.mrc") == bytes("good.mrc")) << i;
        } else {
            expect_error(r, 3, at("b.vdb") + ": ");
        }
    }
}
