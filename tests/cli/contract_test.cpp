// Exit codes, the one line of an error, JSON on standard output, silence on demand.
#include "tests/cli/cli_test.h"
#include "tests/support/mrc_bytes.h"
#include "vdbgeo/view/page_assets.h"

using namespace vdbgeo::test;
using vdbgeo::have_page;

namespace {

class Contract : public Cli {};

void expect_keys(const Json& j, const Words& keys) {
    for (const std::string& key : keys) EXPECT_TRUE(j.contains(key)) << key << "\n" << j.dump();
}

const Words measure_keys{"vertices",      "faces",          "components",    "genus",
                         "closed",        "boundary_edges", "area_A2",       "volume_A3",
                         "min_angle_deg", "max_angle_deg",  "mean_angle_deg"};

}  // namespace

TEST_F(Contract, UsageErrorsAreTwo) {
    const std::string map = phantom("a.mrc", 16), mesh = at("a.ply");
    good({"surface", map, mesh, "--iso", "0", "--quiet"});
    const auto before = listing();
    const std::string out = at("out.vdb"), ply = at("out.ply"), png = at("out.png");
    const std::vector<Words> bad{
        {},
        {"nonsense"},
        {"nonsense", map},
        {"--nonsense"},
        {"info"},
        {"info", map, "--nonsense"},
        {"info", map, "--threads", "0"},
        {"info", map, "--threads", "-1"},
        {"info", map, "--threads", "many"},
        {"info", map, "--threads"},
        {"info", map, "--volume", "-1"},
        {"info", map, "--origin", "1,2"},
        {"info", map, "--origin", "somewhere"},
        {"info", map, "--voxel-size", "0"},
        {"info", map, "--voxel-size", "-1"},
        {"info", map, "--voxel-size", "1,2"},
        {"info", map, "--voxel-size", "nan"},
        {"info", map, "--voxel-size", "1,"},
        {"info", map, "--mode0", "perhaps"},
        {"convert", map},
        {"convert", map, at("out")},
        {"convert", map, at("out.xyz")},
        {"convert", map, at("out.ply")},
        {"convert", map, at("out.vdb.gz")},
        {"convert", map, at("out.mrc"), "--compress", "zip"},
        {"convert", map, at("out.mrc"), "--scale", "much"},
        {"convert", map, at("out.mrc"), "--scale", "0"},
        {"convert", map, at("out.mrc"), "--scale", "1,"},
        {"convert", map, at("out.mrc"), "--mode", "2", "--scale", "2"},
        {"convert", map, at("out.mrc.bz2")},
        {"convert", map, at("out.mrc.zst")},
        {"convert", mesh, out},
        {"convert", mesh, at("out.png")},
        {"convert", map, at("out.mrc"), "--mode", "3"},
        {"convert", map, at("out.mrc"), "--mode", "5"},
        {"convert", map, out, "--compression", "lzma"},
        {"convert", map, out, "--threshold", "much"},
        {"convert", map, out, "--threshold", "auto"},
        {"convert", map, out, "--band", "1"},
        {"convert", map, out, "--threshold", "1", "--band", "-1"},
        {"convert", map, out, at("more.ply")},
        {"phantom", "sphere"},
        {"phantom", "dragon", at("out.mrc")},
        {"phantom", "sphere", at("out.png")},
        {"phantom", "sphere", at("out.mrc.bz2")},
        {"phantom", "sphere", at("out.mrc"), "--truth", at("truth.mrc.zst")},
        {"phantom", "sphere", at("out.mrc"), "--size", "1"},
        {"phantom", "sphere", at("out.mrc"), "--size", "-8"},
        {"phantom", "sphere", at("out.mrc"), "--snr", "0"},
        {"phantom", "sphere", at("out.mrc"), "--period", "3"},
        {"phantom", "sphere", at("out.mrc"), "--seed", "-1"},
        {"surface", map},
        {"surface", map, at("out.vdb")},
        {"surface", map, ply, "--iso", "high"},
        {"surface", map, ply, "--iso", "3 sigma"},
        {"surface", map, ply, "--iso", "nan"},
        {"surface", map, ply, "--iso", "inf"},
        {"surface", map, ply, "--iso", ""},
        {"surface", map, ply, "--iso"},
        {"measure"},
        {"measure", mesh, "--histogram", at("out.txt")},
        {"render", mesh},
        {"render", mesh, at("out.jpg")},
        {"render", map, png, "--iso", "high"},
        {"render", mesh, png, "--width", "1"},
        {"render", mesh, png, "--view", "behind"},
        {"render", mesh, png, "--samples", "3"},
        {"render", mesh, png, "--occlusion", "-1"},
        {"model", map},
        {"model", map, "-o", at("out"), "--iso", "high"},
        {"model", map, "-o", at("out"), "--width", "1"},
    };
    for (const Words& words : bad) {
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 2, "");
    }
    EXPECT_EQ(listing(), before);
}

// What a command line says is looked at before any file is.
TEST_F(Contract, UsageComesBeforeFiles) {
    const std::string none = at("none.mrc");
    expect_error(vdbgeo({"surface", none, at("a.ply"), "--iso", "x"}), 2, "--iso:", "'x'");
    expect_error(vdbgeo({"render", none, at("a.png"), "--iso", "x"}), 2, "--iso:", "'x'");
    expect_error(vdbgeo({"model", none, "-o", at("a"), "--iso", "x"}), 2, "--iso:", "'x'");
    expect_error(vdbgeo({"convert", none, at("a.xyz")}), 2, at("a.xyz") + ":");
    expect_error(vdbgeo({"measure", at("none.ply"), "--histogram", at("a.txt")}), 2, at("a.txt") + ":");
    EXPECT_NE(vdbgeo({"nonsense"}).err.find("nonsense"), std::string::npos);
}

TEST_F(Contract, MissingFilesAreFour) {
    const std::vector<std::pair<std::string, Words>> runs{
        {at("none.mrc"), {"info"}},
        {at("none.vdb"), {"info"}},
        {at("none.ply"), {"info"}},
        {at("none.mrc"), {"convert", at("out.vdb")}},
        {at("none.vdb"), {"convert", at("out.mrc")}},
        {at("none.ply"), {"convert", at("out.obj")}},
        {at("none.mrc"), {"surface", at("out.ply")}},
        {at("none.stl"), {"measure"}},
        {at("none.obj"), {"render", at("out.png")}},
        {at("none.mrc"), {"model", "-o", at("out")}},
        {folder_.path().string(), {"info"}},
    };
    for (auto [file, words] : runs) {
        words.insert(words.begin() + 1, file);
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 4, file + ": ");
    }
    EXPECT_TRUE(listing().empty());
}

TEST_F(Contract, AnIsovalueThatNothingCrossesIsFive) {
    const std::string map = phantom("a.mrc", 16);
    for (const char* iso : {"1e9", "-1e9"}) {
        expect_error(vdbgeo({"surface", map, at("a.ply"), "--iso", iso, "--quiet"}), 5, map + ": ",
                     "no surface at the isovalue");
        expect_error(vdbgeo({"render", map, at("a.png"), "--iso", iso, "--quiet"}), 5, map + ": ");
        expect_error(vdbgeo({"model", map, "-o", at("m"), "--iso", iso, "--quiet"}), 5,
                     at("m/smooth.vdb") + ": ");
        EXPECT_EQ(Json::parse(bytes("m/summary.json"))["status"], "failed");
    }
    EXPECT_FALSE(listing().count("a.ply") || listing().count("a.png") || listing().count("m/surface.ply"));
}

TEST_F(Contract, ErrorsOfTheSmallProgramsBearTheirNames) {
    const std::string text = make("a.mrc", "no map at all, but quite some text\n");
    expect_error(run({MRC2VDB_PROGRAM, text, at("a.vdb")}), 3, text + ": ", "is text", "mrc2vdb");
    expect_error(run({VDB2MRC_PROGRAM, at("none.vdb"), at("b.mrc")}), 4, at("none.vdb") + ": ", "",
                 "vdb2mrc");
    expect_error(run({MRC2VDB_PROGRAM}), 2, "", "", "mrc2vdb");
    expect_error(run({VDB2MRC_PROGRAM, text, at("b.xyz")}), 2, at("b.xyz") + ": ", "", "vdb2mrc");
    MrcBytes odd;
    odd.ispg = 300;
    const Ended r = run({MRC2VDB_PROGRAM, make("odd.mrc", odd.str()), at("odd.vdb"), "--quiet"});
    EXPECT_EQ(r.code, 0);
    EXPECT_EQ(r.err.rfind("mrc2vdb: warning: " + at("odd.mrc") + ": ISPG (word 23) is 300", 0), 0u) << r.err;
}

TEST_F(Contract, QuietIsSilent) {
    const std::string map = phantom("a.mrc", 16), mesh = at("a.ply");
    const std::vector<Words> runs{
        {"info", map},
        {"convert", map, at("a.vdb")},
        {"surface", map, mesh, "--iso", "0"},
        {"measure", mesh},
        {"render", mesh, at("a.png"), "--width", "160", "--occlusion", "0"},
        {"phantom", "sphere", at("b.mrc"), "--size", "8"},
        {"model", map, "-o", at("m"), "--iso", "0", "--width", "160", "--occlusion", "0"}};
    for (Words words : runs) {
        SCOPED_TRACE(joined(words));
        EXPECT_NE(good(words).err, "");
        words.push_back("--quiet");
        const bool warned = words[0] == "model" && !have_page();
        EXPECT_EQ(
            good(words).err,
            warned ? "vdbgeo: warning: this build has no script for the page: nothing in it can be turned\n"
                   : "");
    }
}

TEST_F(Contract, JsonIsOneObjectWithTheStableKeys) {
    const std::string map = phantom("a.mrc", 16), mesh = at("a.ply"), grid = at("a.vdb");
    const Json surface = json({"surface", map, mesh, "--iso", "0"});
    expect_keys(surface, measure_keys);
    expect_keys(surface, {"iso", "method", "seconds"});
    expect_keys(surface.value("seconds", Json::object()), {"read", "compute", "write"});
    EXPECT_EQ(surface["method"], "marching-cubes");

    const Json measure = json({"measure", mesh});
    expect_keys(measure, measure_keys);
    for (const std::string& key : measure_keys)
        EXPECT_EQ(measure.value(key, Json()), surface.value(key, Json())) << key;
    EXPECT_EQ(measure["genus"], 0);
    EXPECT_EQ(measure["closed"], true);
    EXPECT_EQ(measure["boundary_edges"], 0);
    EXPECT_EQ(measure["components"], 1);

    const Json in = json({"info", map});
    expect_keys(in, {"nx", "ny", "nz", "mode", "voxel_size_A", "origin_A", "origin_rule", "axis_order", "min",
                     "max", "mean", "rms", "warnings"});
    EXPECT_EQ(in["nx"], 16);
    EXPECT_EQ(in["axis_order"], Json({1, 2, 3}));
    EXPECT_TRUE(in["warnings"].is_array());

    const Json converted = json({"convert", map, grid}), on_grid = json({"info", grid});
    for (const Json& j : {converted, on_grid}) {
        expect_keys(j,
                    {"active_voxels", "bytes_in_memory", "dense_bytes", "background", "class", "transform"});
        EXPECT_EQ(j["active_voxels"], 16 * 16 * 16);
        EXPECT_EQ(j["dense_bytes"], 4 * 16 * 16 * 16);
    }
    EXPECT_EQ(json({"phantom", "torus", at("t.mrc"), "--size", "8"})["kind"], "torus");
    EXPECT_EQ(json({"render", mesh, at("a.png"), "--width", "160", "--occlusion", "0"})["width"], 160);
    EXPECT_TRUE(json({"model", map, "-o", at("m"), "--iso", "0", "--width", "160", "--occlusion", "0"})
                    .contains("stages"));
    EXPECT_EQ(json({"info", map, mesh})["files"].size(), 2u);
}

TEST_F(Contract, JsonOfAnOpenSurfaceHasNoVolume) {
    phantom("a.mrc", 16, {}, "saddle");
    const Json j = json({"surface", at("a.mrc"), at("a.ply"), "--iso", "0"});
    EXPECT_EQ(j["closed"], false);
    EXPECT_GT(j["boundary_edges"], 0);
    EXPECT_TRUE(j["volume_A3"].is_null());
    EXPECT_TRUE(j["genus"].is_null());
}

// JSON is UTF-8; names of files, and what is not a number, need not be.
TEST_F(Contract, JsonHoldsOddNamesAndNumbers) {
    const std::string odd = at("na\xefve\n\"\\.mrc");
    MrcBytes map;
    map.values.assign(24, NAN);
    write_bytes(odd, map.str());
    const Json j = json({"info", odd});
    EXPECT_EQ(j["nx"], 4);
    EXPECT_TRUE(j["mean"].is_null() || j["mean"].is_number());
    const Ended r = vdbgeo({"info", odd + "none"});
    EXPECT_EQ(r.code, 4);
    EXPECT_EQ(r.err.find('\n'), r.err.size() - 1) << r.err;
}

TEST_F(Contract, WhatIsWrongWithTheContentNamesTheFile) {
    MrcBytes map;
    map.values.assign(24, NAN);
    const std::string in = make("a.mrc", map.str());
    const Ended r = vdbgeo({"surface", in, at("a.ply"), "--quiet"});  // a warning, then the error
    EXPECT_EQ(r.code, 3);
    EXPECT_NE(r.err.find("vdbgeo: error: " + in + ": the map has no finite sample"), std::string::npos)
        << r.err;
    const std::string mesh = make("b.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    const std::string point = make("c.off", "OFF\n3 1 0\n1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n");
    const std::string none = make("d.off", "OFF\n0 0 0\n");
    for (const auto& [file, flag] : std::vector<std::pair<std::string, Words>>{
             {mesh, {"--color-by", "K"}}, {mesh, {"--width", "64"}}, {point, {}}, {none, {}}}) {
        Words words{"render", file, at("a.png"), "--quiet"};
        words.insert(words.end(), flag.begin(), flag.end());
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 3, file + ": ");
    }
    EXPECT_FALSE(listing().count("a.ply") || listing().count("a.png"));
}

TEST_F(Contract, NegativeNumbersAreValues) {
    const std::string map = phantom("a.mrc", 16);
    EXPECT_EQ(json({"surface", map, at("a.ply"), "--iso", "-10.5"})["iso"], -10.5);
    EXPECT_EQ(json({"info", map, "--origin", "-1,-2,-3.5"})["origin_A"], Json({-1.0, -2.0, -3.5}));
    EXPECT_EQ(json({"convert", map, at("a.vdb"), "--background", "-300"})["background"], -300.0);
}

TEST_F(Contract, FromAndToAPipe) {
    const std::string map = phantom("a.mrc", 16);
    RunOptions pipe;
    pipe.input = map;
    EXPECT_EQ(good({"convert", "-", at("a.vdb"), "--quiet"}, pipe).err, "");
    Json plain = json({"info", map});
    const Ended r = good({"info", "-", "--json"}, pipe);
    Json piped = Json::parse(r.out, nullptr, false);
    for (Json* j : {&plain, &piped}) j->erase("file");
    EXPECT_EQ(piped, plain);

    EXPECT_EQ(good({"convert", at("a.vdb"), "-", "--quiet"}).out, [&] {
        good({"convert", at("a.vdb"), at("b.mrc"), "--quiet"});
        return bytes("b.mrc");
    }());
    good({"surface", map, at("a.ply"), "--iso", "0"});
    const Words small{"--width", "160", "--occlusion", "0"};
    Words to_pipe{"render", at("a.ply"), "-"}, to_file{"render", at("a.ply"), at("a.png")};
    to_pipe.insert(to_pipe.end(), small.begin(), small.end());
    to_file.insert(to_file.end(), small.begin(), small.end());
    good(to_file);
    EXPECT_EQ(good(to_pipe).out, bytes("a.png"));
    // Two things cannot both have standard output.
    to_pipe.push_back("--json");
    expect_error(vdbgeo(to_pipe), 2, "-: ");
    expect_error(vdbgeo({"convert", map, "-", "--json"}), 2, "-: ");
    expect_error(vdbgeo({"info", "-", "--validate"}, pipe), 2, "-: ");
}
