// Scenes for other programs, series, and NanoVDB files, as a user makes them.
#include <openvdb/openvdb.h>
#include <openvdb/tools/Diagnostics.h>

#include "converters/map_file.h"
#include "converters/nanovdb_file.h"
#include "converters/vdb_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/data.h"
#include "tests/support/mrc_bytes.h"

using namespace vdbgeo::test;

namespace {

class Scene : public Cli {
 protected:
    /// Names and classes of a scene's grids, from the program's own report.
    static std::vector<std::string> names_of(const Json& result) {
        std::vector<std::string> names;
        for (const Json& grid : result["grids"]) names.push_back(grid["name"]);
        return names;
    }
    openvdb::FloatGrid::Ptr grid(const std::string& file, const std::string& name) const {
        return vdbgeo::read_vdb(folder_ / file, name);
    }
    double max_of(const std::string& file) const {
        return vdbgeo::read_map(folder_ / file).map.statistics.max;
    }
};

TEST_F(Scene, BlenderGetsFogInItsUnits) {
    const std::string in = phantom("p.mrc", 48, {"--voxel-size", "2"});
    const Json j = json({"convert", in, at("b.vdb"), "--for", "blender"});
    EXPECT_EQ(names_of(j), std::vector<std::string>{"density"});
    EXPECT_EQ(j["for"], "blender");
    EXPECT_EQ(j["units_per_A"], 0.01);
    const auto fog = grid("b.vdb", "density");
    EXPECT_EQ(openvdb::tools::checkFogVolume(*fog), "");
    EXPECT_NEAR(fog->voxelSize()[0], 0.02, 1e-12);
    const double low = j["fog"][0], high = j["fog"][1];
    const auto map = vdbgeo::read_map(in).map;
    for (int i = 20; i < 28; ++i) {
        const openvdb::Coord ijk(i, 24, 23);
        EXPECT_NEAR(fog->tree().getValue(ijk), (map.grid->tree().getValue(ijk) - low) / (high - low), 1e-6);
    }
}

TEST_F(Scene, EveryGridThatIsAskedForIsThereInOneFrame) {
    const std::string in = phantom("p.mrc", 48);
    const std::string mask = phantom("m.mrc", 48, {"--radius", "30", "--voxel-size", "1"});
    const Json j = json({"convert", in, at("h.vdb"), "--for", "houdini", "--center", "--units-per-A", "0.1",
                         "--grids", "surface,density,gradient,mean_curvature", "--iso", "0", "--fog", "-5:60",
                         "--add", "mask=" + mask});
    EXPECT_EQ(names_of(j),
              (std::vector<std::string>{"density", "surface", "gradient", "mean_curvature", "mask"}));
    EXPECT_EQ(j["iso"], 0.0);
    EXPECT_EQ(j["fog"], (Json{-5.0, 60.0}));
    const auto surface = grid("h.vdb", "surface");
    EXPECT_EQ(openvdb::tools::checkLevelSet(*surface), "");
    const auto centre = surface->transform().indexToWorld(openvdb::Vec3d(23.5, 23.5, 23.5));
    EXPECT_LT(centre.length(), 1e-9);
    for (const char* name : {"density", "mean_curvature", "mask"})
        EXPECT_EQ(grid("h.vdb", name)->transform(), surface->transform()) << name;
    const auto up = surface->transform().baseMap()->applyJacobian(openvdb::Vec3d(0, 0, 1));
    EXPECT_GT(up.y(), 0);  // the map's z is Houdini's y
    EXPECT_NEAR(up.x(), 0, 1e-12);
    EXPECT_NEAR(up.z(), 0, 1e-12);
}

TEST_F(Scene, WithoutAProgramGridsLieInAngstromBesideTheRawMap) {
    const std::string in = phantom("p.mrc", 40);
    const Json j = json({"convert", in, at("s.vdb"), "--grids", "surface", "--iso", "0"});
    EXPECT_EQ(names_of(j), (std::vector<std::string>{"density", "surface"}));
    const auto raw = vdbgeo::read_map(in).map.grid;
    EXPECT_EQ(grid("s.vdb", "density")->transform(), raw->transform());
    EXPECT_EQ(grid("s.vdb", "density")->tree().getValue({5, 6, 7}), raw->tree().getValue({5, 6, 7}));
    EXPECT_EQ(grid("s.vdb", "surface")->transform(), raw->transform());
}

TEST_F(Scene, AMapOfAnotherFrameButTheSameSizeIsWarnedOf) {
    VDBGEO_NEEDS_DATA("ngl/localResolution.mrc");
    const std::string folder = data_folder().string() + "/ngl/";
    const Ended r = good({"convert", folder + "betaGal.mrc", at("b.vdb"), "--for", "blender", "--add",
                          "resolution=" + folder + "localResolution.mrc", "--quiet"});
    EXPECT_NE(r.err.find("localResolution.mrc: its place or voxel size"), std::string::npos) << r.err;
    const auto resolution = grid("b.vdb", "resolution");
    for (auto it = resolution->cbeginValueOn(); it; ++it) ASSERT_TRUE(*it >= 7 && *it <= 14) << *it;
    EXPECT_EQ(resolution->activeVoxelCount(), grid("b.vdb", "density")->activeVoxelCount());
}

TEST_F(Scene, ASceneCanBeMadeOfAScene) {
    const std::string in = phantom("p.mrc", 32, {"--voxel-size", "3", "--radius", "30"});
    good({"convert", in, at("b.vdb"), "--for", "blender", "--grids", "surface", "--iso", "0", "--quiet"});
    const Ended r = good({"convert", at("b.vdb"), at("h.vdb"), "--for", "houdini", "--quiet"});
    EXPECT_NE(r.err.find("taken back to Å"), std::string::npos) << r.err;
    const auto surface = grid("h.vdb", "surface");  // a level set stays one
    EXPECT_EQ(openvdb::tools::checkLevelSet(*surface), "");
    EXPECT_NEAR(surface->voxelSize()[0], 0.03, 1e-9);
    EXPECT_NEAR(json({"convert", at("b.vdb"), at("back.vdb")})["transform"][0][0].get<double>(), 3, 1e-9);
}

TEST_F(Scene, ASeriesIsNumberedAndSharesItsLevels) {
    phantom("a.mrc", 32, {"--radius", "9", "--voxel-size", "1"});
    phantom("b.mrc", 32, {"--radius", "12", "--voxel-size", "1"});
    const Json j = json({"convert", at("a.mrc"), at("b.mrc"), at("out.vdb"), "--for", "blender", "--grids",
                         "density,surface", "--iso", "0.5", "--fog", "0:"});
    ASSERT_EQ(j["frames"].size(), 2u);
    EXPECT_EQ(j["frames"][0]["out"], at("out_0001.vdb"));
    EXPECT_EQ(j["frames"][1]["out"], at("out_0002.vdb"));
    EXPECT_EQ(j["frames"][0]["fog"], j["frames"][1]["fog"]);  // though the second is denser
    EXPECT_EQ(listing(), (std::set<std::string>{"a.mrc", "b.mrc", "out_0001.vdb", "out_0002.vdb"}));
    EXPECT_NE(bytes("out_0001.vdb"), bytes("out_0002.vdb"));
    EXPECT_EQ(max_of("out_0002.vdb"), 1.0);
    // The first frame alone gives the same file.
    good({"convert", at("a.mrc"), at("one.vdb"), "--for", "blender", "--grids", "density,surface", "--iso",
          "0.5", "--fog", "0:", "--quiet"});
    EXPECT_TRUE(bytes("one.vdb") == bytes("out_0001.vdb"));
}

TEST_F(Scene, AMissingFrameIsToldBeforeAnythingIsWritten) {
    phantom("a.mrc", 24);
    expect_error(vdbgeo({"convert", at("a.mrc"), at("b.mrc"), at("out.vdb"), "--quiet"}), 4, at("b.mrc"));
    EXPECT_EQ(listing(), std::set<std::string>{"a.mrc"});
}

TEST_F(Scene, ABadFrameLeavesTheOthersWhole) {
    phantom("a.mrc", 24);
    make("bad.mrc", "no map");
    const Ended r =
        vdbgeo({"convert", at("a.mrc"), at("bad.mrc"), at("out.vdb"), "--for", "blender", "--quiet"});
    EXPECT_EQ(r.code, 3);
    EXPECT_EQ(listing(), (std::set<std::string>{"a.mrc", "bad.mrc", "out_0001.vdb"}));
}

TEST_F(Scene, AllVolumesOfAStackMakeASeries) {
    MrcBytes stack;
    stack.size = {4, 4, 6};
    stack.sampling = {4, 4, 2};
    stack.ispg = 401;
    for (int i = 0; i < 96; ++i) stack.values.push_back(i);
    const std::string in = make("stack.mrc", stack.str());
    const Json j = json({"convert", in, at("v.vdb"), "--volume", "all"});
    ASSERT_EQ(j["frames"].size(), 3u);
    for (int v = 0; v < 3; ++v)
        EXPECT_EQ(max_of("v_000" + std::to_string(v + 1) + ".vdb"), 32 * (v + 1) - 1) << v;
    EXPECT_EQ(json({"convert", in, at("one.vdb"), "--volume", "1"})["max"], j["frames"][1]["max"]);
    expect_error(vdbgeo({"convert", in, at("x.vdb"), "--volume", "some"}), 2, "");
}

TEST_F(Scene, TheSameBytesForAnyNumberOfThreads) {
    const std::string in = phantom("p.mrc", 64, {"--snr", "2"}, "needle-complex");
    const auto make_scene = [&](const std::string& out, const std::string& threads) {
        good({"convert", in, at(out), "--for", "houdini", "--grids",
              "density,surface,gradient,mean_curvature", "--quiet", "--threads", threads});
    };
    make_scene("1.vdb", "1");
    make_scene("3.vdb", "3");
    EXPECT_TRUE(bytes("1.vdb") == bytes("3.vdb"));
    if (!vdbgeo::have_nanovdb()) return;
    make_scene("1.nvdb", "1");
    make_scene("3.nvdb", "3");
    EXPECT_TRUE(bytes("1.nvdb") == bytes("3.nvdb"));
}

TEST_F(Scene, WhatMakesNoSenseIsOneLine) {
    const std::string in = phantom("p.mrc", 16);
    const auto fails = [&](Words more, const std::string& text, const std::string& out = "x.vdb",
                           int code = 2) {
        Words words{"convert", in, at(out), "--quiet"};
        words.insert(words.end(), more.begin(), more.end());
        expect_error(vdbgeo(words), code, "", text);
    };
    fails({"--for", "maya"}, "blender");
    fails({"--center"}, "need --for");
    fails({"--units-per-A", "2"}, "need --for");
    fails({"--for", "blender", "--units-per-A", "0"}, "--units-per-A");
    fails({"--grids", "density,colour"}, "'colour' is none of");
    fails({"--fog", "3"}, "not LOW:HIGH");
    fails({"--fog", "3:2"}, "have to rise");
    fails({"--fog", "x:2"}, "not an isovalue");
    fails({"--add", "mask"}, "NAME=FILE");
    fails({"--add", "surface=" + in}, "is taken");
    fails({"--add", "m=" + at("none.mrc")}, "none.mrc", "x.vdb", 4);
    fails({"--for", "blender"}, "scene", "x.mrc");
    fails({"--for", "blender", "--fog", "1e6:2e6"}, "try another --fog", "x.vdb", 5);
    fails({"--grids", "surface", "--iso", "1e6"}, "no surface", "x.vdb", 5);
    EXPECT_EQ(listing(), std::set<std::string>{"p.mrc"});
}

}  // namespace
