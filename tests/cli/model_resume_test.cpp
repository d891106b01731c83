// Options of a model by stage, and what is taken over from an earlier run.
#include <algorithm>
#include <map>

#include "converters/map_file.h"
#include "converters/vdb_file.h"
#include "tests/cli/cli_test.h"
#include "vdbgeo/tet/delaunay_tetrahedra.h"

using namespace vdbgeo::test;

namespace {

namespace fs = std::filesystem;

class ModelRuns : public Cli {
 protected:
    void SetUp() override { map_ = phantom("a.mrc", 40, {}, "torus"); }

    Words words(const std::string& map, Words more, const std::string& folder = "m") const {
        Words all{"model", map, "-o", at(folder), "--width", "200", "--occlusion", "0", "--quiet", "--json"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    Json model(const Words& more, const std::string& folder = "m") const {
        const Ended r = good(words(map_, more, folder));
        return Json::parse(r.out, nullptr, false);
    }
    static std::map<std::string, std::string> statuses(const Json& summary) {
        std::map<std::string, std::string> all;
        for (const Json& entry : summary["stages"]) all[entry["name"]] = entry["status"];
        return all;
    }
    static Json stage(const Json& summary, const std::string& name) {
        for (const Json& entry : summary["stages"])
            if (entry["name"] == name) return entry;
        return {};
    }
    Json read_summary(const std::string& folder = "m") const {
        return Json::parse(bytes(folder + "/summary.json"), nullptr, false);
    }
    /// Names of the stages with this status, in order of the alphabet.
    static Words with_status(const Json& summary, const std::string& status) {
        Words names;
        for (const auto& [name, s] : statuses(summary))
            if (s == status) names.push_back(name);
        return names;
    }
    void expect_same_results(const std::string& a, const std::string& b) const {
        for (const char* name : {"density.vdb", "surface.ply", "mesh.ply", "curved.ply", "pockets.csv",
                                 "tets.vtu", "map.png", "mean.png", "angles.svg"})
            EXPECT_TRUE(bytes(a + "/" + name) == bytes(b + "/" + name)) << name;
    }

    std::string map_;
};

}  // namespace

TEST_F(ModelRuns, ASecondRunTakesEverythingOver) {
    const Json first = model({"--iso", "0"});
    const std::string curved = bytes("m/curved.ply");
    const Json second = model({"--iso", "0"});
    EXPECT_EQ(with_status(second, "done"), Words{"report"});
    EXPECT_TRUE(with_status(second, "failed").empty());
    for (const char* name : {"surface", "curvature", "tets"})
        EXPECT_EQ(stage(second, name)["result"], stage(first, name)["result"]) << name;
    EXPECT_TRUE(bytes("m/curved.ply") == curved);
    EXPECT_EQ(statuses(model({"--iso", "0", "--fresh"}))["map"], "done");
}

TEST_F(ModelRuns, OnlyWhatDependsOnAChangeRunsAgain) {
    model({"--iso", "0"});
    const Json pockets = model({"--iso", "0", "--set", "pockets.min-area=1"});
    EXPECT_EQ(statuses(pockets)["curvature"], "reused");
    EXPECT_EQ(statuses(pockets)["pockets"], "done");
    EXPECT_EQ(statuses(pockets)["tets"], "reused");
    const Json level = model({"--iso", "-5", "--set", "pockets.min-area=1"});
    EXPECT_EQ(statuses(level)["denoise"], "reused");
    EXPECT_EQ(statuses(level)["surface"], "done");
    EXPECT_EQ(statuses(level)["tets"], "done");
}

TEST_F(ModelRuns, TheMapIsKnownByWhatItHolds) {
    model({"--iso", "0"});
    fs::copy_file(map_, at("copy.mrc"));
    Json summary = Json::parse(good(words(at("copy.mrc"), {"--iso", "0"})).out, nullptr, false);
    EXPECT_EQ(statuses(summary)["map"], "reused");
    const std::string other = phantom("b.mrc", 40);
    summary = Json::parse(good(words(other, {"--iso", "0"})).out, nullptr, false);
    EXPECT_EQ(statuses(summary)["map"], "done");
    EXPECT_EQ(stage(summary, "measure")["result"]["files"][0]["genus"], 0);
}

TEST_F(ModelRuns, ADamagedFileIsMadeAgain) {
    model({"--iso", "0"});
    const std::string whole = bytes("m/surface.ply");
    make("m/surface.ply", whole.substr(0, whole.size() / 2));
    const Json again = model({"--iso", "0"});
    EXPECT_EQ(statuses(again)["surface"], "done");
    EXPECT_EQ(statuses(again)["remesh"], "reused");  // its input is what it was
    EXPECT_TRUE(bytes("m/surface.ply") == whole);
}

TEST_F(ModelRuns, InPartsGivesTheSameBytes) {
    model({"--iso", "0"}, "whole");
    const Json part = model({"--iso", "0", "--to", "surface"});
    EXPECT_EQ(statuses(part).count("remesh"), 0u);
    EXPECT_FALSE(fs::exists(at("m/mesh.ply")));
    EXPECT_EQ(part["status"], "done");
    const Json rest = model({"--iso", "0", "--from", "remesh"});
    EXPECT_EQ(statuses(rest)["surface"], "reused");
    EXPECT_EQ(statuses(rest)["remesh"], "done");
    expect_same_results("m", "whole");
    // A surface changed by hand is used as it is.
    good({"smooth", at("m/surface.ply"), at("smoothed.ply")});
    fs::copy_file(at("smoothed.ply"), at("m/surface.ply"), fs::copy_options::overwrite_existing);
    const Json changed = model({"--iso", "0", "--from", "remesh"});
    EXPECT_EQ(statuses(changed)["remesh"], "done");
    EXPECT_FALSE(bytes("m/mesh.ply") == bytes("whole/mesh.ply"));
    expect_error(vdbgeo(words(map_, {"--from", "remesh"}, "nowhere")), 3, at("nowhere"), "--from remesh");
    EXPECT_FALSE(fs::exists(at("nowhere")));
    fs::create_directory(at("empty"));
    expect_error(vdbgeo(words(map_, {"--from", "remesh"}, "empty")), 3, at("empty"), "density.vdb");
}

TEST_F(ModelRuns, AFileOfOptionsAndASummaryAreOptions) {
    const std::string config = make("c.json", R"({
        // comments are allowed
        "preset": "molecule", "surface": {"iso": 0}, "remesh": {"length": 6.5},
        "pockets": false, "curvature": {"sample": ["density=)" +
                                                  map_ + R"("]}, "tets": {"cell": 1.5}})");
    const Json first = model({"--config", config});
    EXPECT_EQ(statuses(first)["pockets"], "off");
    EXPECT_EQ(stage(first, "remesh")["result"]["length_A"], 6.5);
    EXPECT_FALSE(fs::exists(at("m/pockets.csv")));
    // The command line has the last word.
    const Json longer = model({"--config", config, "--set", "remesh.length=8", "--skip", "tets"}, "longer");
    EXPECT_EQ(stage(longer, "remesh")["result"]["length_A"], 8);
    EXPECT_EQ(statuses(longer)["tets"], "off");
    // The summary alone gives the same model again, map and all.
    Words again{"model", "-o", at("again"), "--config", at("m/summary.json"), "--quiet", "--json"};
    const Json second = Json::parse(good(again).out, nullptr, false);
    EXPECT_EQ(second["options"], first["options"]);
    for (const char* name : {"surface.ply", "mesh.ply", "curved.ply", "tets.vtu", "map.png"})
        EXPECT_TRUE(bytes(std::string("m/") + name) == bytes(std::string("again/") + name)) << name;
}

TEST_F(ModelRuns, AllOptionsArePrintedAsAFileThatChangesNothing) {
    const std::string all = good({"model", "--print-options"}).out;
    for (const char* text : {"\"remesh\": {", "// \"length\":", "in Å", "// \"threshold\":", "\"report\": {"})
        EXPECT_NE(all.find(text), std::string::npos) << text;
    const Json options = Json::parse(all, nullptr, false, true);
    ASSERT_TRUE(options.is_object());
    for (const auto& item : options.items()) EXPECT_TRUE(item.value().empty()) << item.key();
    model({"--iso", "0"}, "plain");
    model({"--iso", "0", "--config", make("all.json", all)}, "all");
    expect_same_results("plain", "all");
    // An option whose comment is taken away counts.
    std::string one = all;
    const std::string off = "// \"length\": \"\",";
    ASSERT_NE(one.find(off), std::string::npos);
    one.replace(one.find(off), off.size(), "\"length\": 7,");
    const Json set = model({"--iso", "0", "--config", make("one.json", one), "--to", "remesh"}, "one");
    EXPECT_EQ(stage(set, "remesh")["result"]["length_A"], 7);
}

TEST_F(ModelRuns, WhatFailsIsToldAndTheRestIsThere) {
    const std::string odd = make("odd.mrc", "no map at all, but quite some text\n");
    const Ended r = vdbgeo(words(map_, {"--iso", "0", "--set", "curvature.map=" + odd}));
    EXPECT_EQ(r.code, 5);
    EXPECT_NE(r.err.find("curvature, pockets failed"), std::string::npos) << r.err;
    const Json summary = read_summary();
    EXPECT_EQ(summary["status"], "failed");
    EXPECT_EQ(statuses(summary)["curvature"], "failed");
    EXPECT_NE(stage(summary, "curvature")["error"].get<std::string>().find("odd.mrc"), std::string::npos);
    EXPECT_EQ(statuses(summary)["tets"], "done");
    EXPECT_EQ(statuses(summary)["pictures"], "done");
    EXPECT_TRUE(fs::exists(at("m/report.html")));
}

TEST_F(ModelRuns, ABadMapLeavesNothing) {
    expect_error(vdbgeo(words(make("bad.mrc", "no map"), {})), 3, at("bad.mrc"));
    EXPECT_FALSE(fs::exists(at("m")));
    expect_error(vdbgeo(words(at("missing.mrc"), {})), 4, at("missing.mrc"));
    EXPECT_FALSE(fs::exists(at("m")));
}

TEST_F(ModelRuns, BadOptionsAreRefusedBeforeAnythingIsDone) {
    const auto refused = [&](const Words& more, int code, const std::string& subject,
                             const std::string& text) {
        expect_error(vdbgeo(words(map_, more)), code, subject, text);
        EXPECT_FALSE(fs::exists(at("m")));
    };
    refused({"--set", "soup.salt=1"}, 2, "--set soup.salt=1", "no stage");
    refused({"--set", "remesh.salt=1"}, 2, "remesh", "salt");
    refused({"--set", "remesh.length=long"}, 2, "remesh", "length");
    refused({"--skip", "map"}, 2, "", "without the stage map");
    refused({"--from", "tets", "--to", "surface"}, 2, "--from tets", "after");
    refused({"--to", "soup"}, 2, "--to soup", "expected one of map");
    refused({"--preset", "soup"}, 2, "--preset", "soup");
    refused({"--config", make("a.json", "[1]")}, 3, at("a.json"), "JSON");
    refused({"--config", make("b.json", R"({"soup": {}})")}, 3, at("b.json"), "soup");
    refused({"--config", make("c.json", R"({"remesh": 3})")}, 3, at("c.json"), "remesh");
    refused({"--config", at("none.json")}, 4, at("none.json"), "");
    expect_error(vdbgeo({"model", "-o", at("m")}), 2, "a map is needed");
    expect_error(vdbgeo({"model", map_}), 2, "a folder");
}

TEST_F(ModelRuns, InterruptedItGoesOnWhereItWas) {
    model({"--iso", "0"}, "whole");
    RunOptions options;
    options.signal = SIGINT;
    options.signal_at = "surface";  // the line that tells its time
    Words talking = words(map_, {"--iso", "0"});
    talking.erase(std::find(talking.begin(), talking.end(), "--quiet"));
    const Ended r = vdbgeo(talking, options);
    EXPECT_EQ(r.code, 130) << r.err;
    const Json broken = read_summary();
    EXPECT_EQ(broken["status"], "interrupted");
    EXPECT_EQ(statuses(broken)["map"], "done");
    const Json rest = model({"--iso", "0"});
    EXPECT_EQ(statuses(rest)["map"], "reused");
    EXPECT_EQ(rest["status"], "done");
    expect_same_results("m", "whole");
}

TEST_F(ModelRuns, OfLabelsFillsEachOfThem) {
    if (!vdbgeo::have_delaunay_tetrahedra()) GTEST_SKIP() << "labels are filled by CGAL";
    // Two halves of a ball, as a segmentation.
    phantom("ball.mrc", 32);
    vdbgeo::MapFile in = vdbgeo::read_map(at("ball.mrc"));
    for (auto it = in.map.grid->beginValueAll(); it; ++it) it.setValue(0);
    auto write = in.map.grid->getAccessor();
    for (int x = 4; x < 28; ++x)
        for (int y = 4; y < 28; ++y)
            for (int z = 4; z < 28; ++z)
                if (vdbgeo::Vec3d(x - 15.5, y - 15.5, z - 15.5).norm() < 11)
                    write.setValueOn(openvdb::Coord(x, y, z), x < 16 ? 1.0f : 2.0f);
    vdbgeo::write_vdb({in.map.grid}, at("labels.vdb"));
    good({"convert", at("labels.vdb"), at("labels.mrc"), "--quiet"});
    const Json summary =
        Json::parse(good(words(at("labels.mrc"), {"--preset", "label"})).out, nullptr, false);
    EXPECT_EQ(summary["status"], "done");
    EXPECT_EQ(statuses(summary)["denoise"], "off");
    EXPECT_EQ(stage(summary, "tets")["result"]["regions"].size(), 2u);
    EXPECT_EQ(statuses(summary)["curvature"], "done");
    for (const char* name : {"m/surface.ply", "m/curved.ply", "m/map.png", "m/report.html"})
        EXPECT_TRUE(fs::exists(at(name))) << name;
}
