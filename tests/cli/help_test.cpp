// Help, versions and the examples they show.
#include <sstream>

#include "converters/map_file.h"
#include "converters/map_parts.h"
#include "converters/tet_file.h"
#include "tests/cli/cli_test.h"
#include "tests/support/tet_meshes.h"

using namespace vdbgeo::test;

namespace {

const Words all_commands{"info",     "convert",    "phantom",   "denoise",  "edges",          "transform",
                         "flow",     "surface",    "remesh",    "simplify", "smooth",         "repair",
                         "measure",  "components", "curvature", "pockets",  "tetrahedralize", "cutaway",
                         "validate", "render",     "model",     "report",   "merge"};

struct Promise {
    const char* command;
    Words texts;  // units and defaults
};

const std::vector<Promise> promises{
    {"info",
     {"--histogram", "PNG or SVG", "Voxel size in Å", "--origin TEXT=auto", "x,y,z in Å", "--volume INT=0",
      "[all]"}},
    {"convert", {"Voxel size in Å", "in the map's units", "sigma", "0, 1, 2, 6, 12 or 101", "[blosc]"}},
    {"phantom",
     {"--size INT=128", "Voxel size in Å", "Radius in Å", "Height in Å", "Period in Å", "[no noise]"}},
    {"denoise",
     {"--method TEXT=hyperdiffusion", "voxels^(2q+2)", "in the map's units a voxel", "[auto]", "--memory",
      "--preview", "--spectra", "[0.9 of it]"}},
    {"edges", {"--order INT=0", "--time FLOAT=10", "voxels^(2q+2)", "--preview"}},
    {"transform",
     {"--orders", "--times", "in voxels^(2q+2)", "[inf]", "--keep", "--band-pass", "OUT_mode_1.mrc"}},
    {"flow", {"--surface", "voxels^2", "--iso TEXT=auto", "signed distances in Å", "--density-scale"}},
    {"surface",
     {"--iso TEXT=auto", "in the map's units", "Nsigma", "Voxel size in Å", "--method TEXT=marching-cubes",
      "in voxels, or in Å", "in Å³", "in Å²", "in seconds", "--memory", "--scratch", "[as it comes]"}},
    {"remesh", {"--method TEXT=isotropic", "in Å", "in degrees", "[mean edge of the input]"}},
    {"simplify", {"--faces", "in Å"}},
    {"smooth", {"--method TEXT=taubin", "in Å^4"}},
    {"repair", {"--max-hole UINT=1000"}},
    {"measure", {".ply .obj .off .stl", "PNG"}},
    {"curvature",
     {"--method TEXT=auto", "in 1/Å", "in voxels", "in Å", "--degree INT=2", "--area", "NAME=MAP", "--plane",
      "--dark"}},
    {"pockets",
     {"in 1/Å", "in Å²", "in Å [", "--list UINT=20", "--protrusions", "--ambient-radius", "--picture"}},
    {"components", {"in Å³", "in Å²", "--list UINT=20"}},
    {"tetrahedralize",
     {"--iso TEXT=auto", "in voxels (of a mesh: mean edges), or in Å", "in degrees", "in Å³", "in seconds",
      "--coarsening INT=3", "--optimize-bounds TEXT=20:130", "[stuffing for a map"}},
    {"cutaway",
     {"--plane TEXT=y", "x,y,z in Å", "in Å³", "--at FLOAT=0.5", "--property TEXT=min_dihedral_deg",
      "--width INT=1600", "PNG"}},
    {"validate", {"--table", "[all]", "0.0125 Å"}},
    {"render",
     {"--width INT=1600", "in pixels", "--view TEXT=three", "--samples INT=", "--occlusion INT=", "--slice",
      "z=120A", "x,y,z in Å", "--turntable", "[white]"}},
    {"model",
     {"--iso TEXT=auto", "in pixels [1000]", "Voxel size in Å", "-o,--out", "--preset TEXT=molecule", "--set",
      "--from"}},
    {"report", {"--faces UINT=200000", "--tets UINT=200000", "[10 million]", "--title"}},
    {"merge", {"[blosc]", "--memory", "0, 1, 2, 6, 12 or 101"}}};

/// The words of the lines below "Example:" that call a program.
std::vector<Words> examples_in(const std::string& help) {
    std::vector<Words> found;
    std::istringstream lines(help.substr(std::min(help.find("Example:"), help.size())));
    for (std::string line; std::getline(lines, line);) {
        if (line.rfind("  vdbgeo ", 0) != 0) continue;
        std::istringstream words(line);
        found.emplace_back();
        for (std::string word; words >> word;) found.back().push_back(word);
    }
    return found;
}

class Help : public Cli {};

}  // namespace

TEST_F(Help, ProgramsTellTheirVersions) {
    for (const char* program : {VDBGEO_PROGRAM, MRC2VDB_PROGRAM, VDB2MRC_PROGRAM}) {
        const Ended r = run({program, "--version"});
        EXPECT_EQ(r.code, 0) << program;
        EXPECT_EQ(r.out.rfind("vdbgeo ", 0), 0u) << r.out;
        EXPECT_NE(r.out.find("openvdb"), std::string::npos) << r.out;
        EXPECT_EQ(r.err, "");
    }
}

TEST_F(Help, ListsEveryCommandAndTheExitCodes) {
    const Ended r = vdbgeo({"--help"});
    EXPECT_EQ(r.code, 0);
    EXPECT_EQ(r.err, "");
    for (const std::string& command : all_commands)
        EXPECT_NE(r.out.find("\n  " + command + " "), std::string::npos) << command;
    for (const char* code :
         {"0 done", "2 usage", "3 bad input", "4 reading or writing", "5 the computation", "130 int"})
        EXPECT_NE(r.out.find(code), std::string::npos) << code;
}

TEST_F(Help, OfEachCommandHasAnExampleUnitsAndDefaults) {
    ASSERT_EQ(promises.size(), all_commands.size());
    for (const Promise& promise : promises) {
        const Ended r = vdbgeo({promise.command, "--help"});
        EXPECT_EQ(r.code, 0);
        EXPECT_EQ(r.err, "");
        EXPECT_FALSE(examples_in(r.out).empty()) << r.out;
        for (const std::string& text : promise.texts)
            EXPECT_NE(r.out.find(text), std::string::npos) << promise.command << ": " << text;
        for (const char* common : {"--json", "--quiet", "--threads"})
            EXPECT_NE(r.out.find(common), std::string::npos) << promise.command << ": " << common;
    }
    for (const char* program : {MRC2VDB_PROGRAM, VDB2MRC_PROGRAM}) {
        const Ended r = run({program, "--help"});
        EXPECT_EQ(r.code, 0);
        EXPECT_NE(r.out.find("Voxel size in Å"), std::string::npos);
    }
}

// The examples as they stand, in a folder that has their files: maps and meshes made for the purpose.
TEST_F(Help, ExamplesRun) {
    phantom("emd_1080.map", 24);
    phantom("other.map", 24, {}, "torus");
    phantom("tomogram.rec", 32, {"--snr", "5"}, "atpase");
    good({"surface", at("emd_1080.map"), at("groel.ply"), "--iso", "0.8"});
    vdbgeo::write_tets(ball_tets(10, 3), at("groel.vtu"));
    std::filesystem::create_directory(at("smooth.parts"));
    const vdbgeo::DensityMap whole = vdbgeo::read_map(at("emd_1080.map")).map;
    vdbgeo::write_map_part(whole, {openvdb::Coord(0), openvdb::Coord(31)}, 0, at("smooth.parts"));
    RunOptions here;
    here.folder = folder_.path();
    for (const std::string& command : all_commands) {
        for (Words words : examples_in(good({command, "--help"}).out)) {
            words[0] = VDBGEO_PROGRAM;
            EXPECT_EQ(words[1], command);
            // Small enough for a test; the last value of a flag that is given twice is refused, so replace.
            for (std::size_t i = 2; i + 1 < words.size(); ++i)
                if (words[i] == "--size") words[i + 1] = "24";
            const bool sections = joined(words).find("--slices") != std::string::npos;
            const bool picture = (command == "render" && !sections) || command == "model" ||
                                 (command == "cutaway" && words[3].find(".png") != std::string::npos);
            if (picture || joined(words).find("--picture") != std::string::npos)
                for (const char* word : {"--width", "160"}) words.push_back(word);
            if (picture)
                for (const char* word : {"--occlusion", "0"}) words.push_back(word);
            const Ended r = run(words, here);
            EXPECT_EQ(r.code, 0) << joined(words) << "\n" << r.err;
        }
    }
    for (const char* made : {"emd_1080.vdb",      "smooth.mrc",        "smooth.png",
                             "median.mrc",        "edges.mrc",         "groel_mode_3.mrc",
                             "groel_residue.mrc", "band.mrc",          "flowed.mrc",
                             "smooth.vdb",        "atpase.mrc",        "clean.mrc",
                             "groel.png",         "groel/surface.ply", "good.ply",
                             "even.ply",          "curved.ply",        "small.ply",
                             "near.ply",          "smooth.ply",        "round.ply",
                             "sound.ply",         "clean.ply",         "levels.png",
                             "density.svg",       "spectra.svg",       "k.svg",
                             "k1k2.svg",          "pockets.csv",       "pockets.png",
                             "tips.json",         "inside.png",        "half.ply",
                             "peeled.png",        "groel/report.html", "both.png",
                             "slices.png",        "film_0004.png",     "tomo/report.html",
                             "other/report.html"})
        EXPECT_TRUE(listing().count(made)) << made;
}
