// The files in the programs that they are made for: Blender, and OpenVDB's own tools and Python module.
#include <png.h>

#include <array>
#include <cstdlib>

#include "converters/map_file.h"
#include "converters/nanovdb_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/data.h"
#include "vdbgeo/volume/fog.h"

using namespace vdbgeo::test;

namespace {

constexpr const char* blender = "/usr/bin/blender";
constexpr const char* python = "/usr/bin/python3";

bool have_pyopenvdb() { return run({python, "-c", "import pyopenvdb, numpy"}).code == 0; }

#define NEEDS_PROGRAM(path) \
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "needs " << (path)

class OtherPrograms : public Cli {
 protected:
    void SetUp() override {
        VDBGEO_NEEDS_DATA("ngl/betaGal.mrc");
        map_ = (data_folder() / "ngl/betaGal.mrc").string();
    }
    Ended run_blender(const std::string& script, const Words& arguments) const {
        Words words{blender,
                    "--background",
                    "--factory-startup",
                    "--python-exit-code",
                    "9",
                    "--python",
                    std::string(VDBGEO_SOURCE_FOLDER) + script,
                    "--"};
        words.insert(words.end(), arguments.begin(), arguments.end());
        return run(words);
    }
    std::string map_;
};

TEST_F(OtherPrograms, BlenderShowsTheGridsWhereTheyBelong) {
    NEEDS_PROGRAM(blender);
    const Json made = json({"convert", map_, at("b.vdb"), "--for", "blender", "--units-per-A", "0.1",
                            "--grids", "density,surface,gradient", "--iso", "0.05"});
    const Ended r = run_blender("/tests/cli/blender_check.py", {at("b.vdb"), "surface=0", "density=0.5"});
    const auto line = r.out.find("RESULT ");
    ASSERT_NE(line, std::string::npos) << r.out << r.err;
    const Json seen = Json::parse(r.out.substr(line + 7, r.out.find('\n', line) - line - 7));
    EXPECT_TRUE(seen["loaded"]);
    EXPECT_EQ(seen["grids"].size(), 3u);
    EXPECT_EQ(seen["grids"]["density"]["type"], "FLOAT");
    EXPECT_EQ(seen["grids"]["surface"]["type"], "FLOAT");
    EXPECT_EQ(seen["grids"]["gradient"]["type"], "VECTOR_FLOAT");
    for (int a = 0; a < 3; ++a)
        EXPECT_NEAR(
            seen["grids"]["density"]["matrix"][static_cast<std::size_t>(a)][static_cast<std::size_t>(a)],
            0.354, 1e-6);

    // Blender's box is that of the leaves: it holds the active voxels and is less than a leaf larger.
    const auto surface = vdbgeo::read_map(at("b.vdb"),
                                          [] {
                                              vdbgeo::MapReadOptions options;
                                              options.grid = "surface";
                                              return options;
                                          }())
                             .map;
    const auto box = surface.grid->evalActiveVoxelBoundingBox();
    for (std::size_t a = 0; a < 3; ++a) {
        const double low = 0.354 * box.min()[static_cast<int>(a)],
                     high = 0.354 * box.max()[static_cast<int>(a)];
        EXPECT_LE(seen["low"][a], low + 1e-4);
        EXPECT_GE(seen["low"][a], low - 8 * 0.354);
        EXPECT_GE(seen["high"][a], high - 1e-4);
        EXPECT_LE(seen["high"][a], high + 8 * 0.354);
    }

    // Its mesh of the level set holds the volume of our surface; its mesh of the fog that of the same
    // density.
    const auto volume_at = [&](const std::string& iso) {
        return json({"surface", map_, at("s.ply"), "--iso", iso})["volume_A3"].get<double>() * 1e-3;
    };
    const double want = volume_at("0.05");
    EXPECT_NEAR(seen["meshes"]["surface"]["volume"], want, 0.01 * want);
    const double low = made["fog"][0], high = made["fog"][1],
                 half = volume_at(std::to_string((low + high) / 2));
    EXPECT_NEAR(seen["meshes"]["density"]["volume"], half, 0.03 * half);
}

/// Pixels that are brighter than the dark ground of blender_frame.py.
std::size_t bright_pixels(const std::string& path) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&image, path.c_str())) return 0;
    image.format = PNG_FORMAT_GRAY;
    std::vector<unsigned char> pixels(PNG_IMAGE_SIZE(image));
    png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr);
    return static_cast<std::size_t>(
        std::count_if(pixels.begin(), pixels.end(), [](unsigned char p) { return p > 70; }));
}

TEST_F(OtherPrograms, BlenderRendersAFrame) {
    NEEDS_PROGRAM(blender);
    good({"convert", map_, at("b.vdb"), "--for", "blender", "--grids", "density,surface", "--quiet"});
    for (const bool surface : {false, true}) {
        Words words{at("b.vdb"), at("p.png"), "--width", "60", "--height", "60", "--samples", "4"};
        if (surface) words.push_back("--surface");
        const Ended r = run_blender("/scripts/blender_frame.py", words);
        ASSERT_EQ(r.code, 0) << r.out << r.err;
        const std::size_t bright = bright_pixels(at("p.png"));
        EXPECT_GT(bright, 3600u / 20) << surface;     // the particle
        EXPECT_LT(bright, 3600u * 3 / 4) << surface;  // and the dark around it
        std::filesystem::remove(at("p.png"));
    }
    EXPECT_NE(run_blender("/scripts/blender_frame.py", {at("b.vdb"), at("p.png"), "--grid", "none"}).code, 0);
}

TEST_F(OtherPrograms, OpenVdbsPythonModuleReadsNamesPlacesAndValues) {
    if (!have_pyopenvdb()) GTEST_SKIP() << "needs python3-openvdb";
    const Json made = json({"convert", map_, at("h.vdb"), "--for", "houdini", "--center", "--grids",
                            "density,surface,mean_curvature"});
    const std::string script = R"(
import json, sys, pyopenvdb as vdb
grids, _ = vdb.readAll(sys.argv[1])
out = {}
for g in grids:
    out[g.name] = {"class": g.gridClass, "voxel": list(g.transform.voxelSize()), "background": g.background,
                   "origin": list(g.transform.indexToWorld((0, 0, 0))), "z": list(g.transform.indexToWorld((0, 0, 1))),
                   "count": g.activeVoxelCount(), "at": g.getConstAccessor().getValue(tuple(map(int, sys.argv[2:5])))}
print(json.dumps(out))
)";
    const Ended r = run({python, "-c", script, at("h.vdb"), "46", "45", "31"});
    ASSERT_EQ(r.code, 0) << r.err;
    const Json seen = Json::parse(r.out);
    ASSERT_EQ(seen.size(), 3u);
    EXPECT_EQ(seen["density"]["class"], "fog volume");
    EXPECT_EQ(seen["surface"]["class"], "level set");
    const auto map = vdbgeo::read_map(map_).map;
    const double v = map.grid->tree().getValue(openvdb::Coord(46, 45, 31));
    const double low = made["fog"][0], high = made["fog"][1];
    ASSERT_GT(v, low);
    ASSERT_LT(v, high);
    EXPECT_NEAR(seen["density"]["at"], (v - low) / (high - low), 1e-6);
    for (const Json& grid : made["grids"])
        EXPECT_EQ(seen[grid["name"].get<std::string>()]["count"], grid["active_voxels"]);
    for (const char* name : {"density", "surface", "mean_curvature"}) {
        const Json& grid = seen[name];
        EXPECT_NEAR(grid["voxel"][0], 0.0354, 1e-9);
        const double half = 0.0354 * 99 / 2;
        EXPECT_NEAR(grid["origin"][0], -half, 1e-6);
        EXPECT_NEAR(grid["origin"][1], -half, 1e-6);
        EXPECT_NEAR(grid["origin"][2], half, 1e-6);  // z = -y
        EXPECT_NEAR(grid["z"][1].get<double>() - grid["origin"][1].get<double>(), 0.0354, 1e-6);
    }
}

TEST_F(OtherPrograms, VdbPrintAndVdbToolReadTheGrids) {
    good({"convert", map_, at("b.vdb"), "--for", "blender", "--grids", "density,surface", "--quiet"});
    int asked = 0;
    for (const Words& words : {Words{"/usr/bin/vdb_print", "-l", at("b.vdb")},
                               Words{"/usr/bin/vdb_tool", "-read", at("b.vdb"), "-print"}}) {
        if (!std::filesystem::exists(words[0])) continue;
        ++asked;
        const Ended r = run(words);
        EXPECT_EQ(r.code, 0) << r.err;
        for (const char* name : {"density", "surface"})
            EXPECT_NE((r.out + r.err).find(name), std::string::npos) << words[0] << r.out;
    }
    if (asked == 0) GTEST_SKIP() << "needs vdb_print or vdb_tool (libopenvdb-tools)";
}

TEST_F(OtherPrograms, NanoVdbsToolsTakeTheFile) {
    if (!vdbgeo::have_nanovdb()) GTEST_SKIP() << "this build writes no NanoVDB files (libnanovdb-dev)";
    NEEDS_PROGRAM("/usr/bin/nanovdb_print");
    NEEDS_PROGRAM("/usr/bin/nanovdb_validate");
    good({"convert", map_, at("b.nvdb"), "--for", "blender", "--grids", "density,surface,gradient",
          "--quiet"});
    const Ended print = run({"/usr/bin/nanovdb_print", at("b.nvdb")});
    EXPECT_EQ(print.code, 0);
    for (const char* text : {"density", "surface", "gradient", "FOG", "SDF"})
        EXPECT_NE(print.out.find(text), std::string::npos) << print.out;
    const Ended valid = run({"/usr/bin/nanovdb_validate", "-v", at("b.nvdb")});
    EXPECT_EQ(valid.code, 0) << valid.out << valid.err;
}

}  // namespace
