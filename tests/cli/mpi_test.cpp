// vdbgeo-mpi under mpirun: the bytes of vdbgeo, for any number of processes.
#include "converters/map_file.h"
#include "tests/cli/mpi_run.h"
#include "vdbgeo/surface/level_set.h"

using namespace vdbgeo::test;

#ifdef VDBGEO_MPI_PROGRAM

namespace {

namespace fs = std::filesystem;

class Mpi : public MpiCli {
 protected:
    /// The same command by vdbgeo and by so many processes.
    void expect_same(const Words& words, const std::string& ending, const std::vector<int>& processes) {
        SCOPED_TRACE(joined(words));
        const auto with_out = [&](const std::string& name) {
            Words all = words;
            all.insert(all.begin() + 2, at(name));
            all.push_back("--quiet");
            return all;
        };
        good(with_out("one" + ending));
        const std::string expected = bytes("one" + ending);
        for (const int n : processes)
            for (const int threads : {1, 2}) {
                const Ended r = mpi(n, with_out("many" + ending), threads);
                EXPECT_EQ(r.code, 0) << r.err;
                EXPECT_TRUE(bytes("many" + ending) == expected)
                    << n << " processes, " << threads << " threads";
                EXPECT_FALSE(fs::exists(folder_ / ("many" + ending + ".parts")));
            }
    }
};

}  // namespace

TEST_F(Mpi, DenoisesToTheSameBytes) {
    const std::string map = noisy();
    expect_same({"denoise", map, "--order", "0", "--sigma", "local", "--steps", "24"}, ".mrc", {1, 2, 4, 5});
    expect_same({"denoise", map, "--order", "1", "--threshold", "1sigma", "--steps", "9"}, ".vdb", {2, 5});
    expect_same({"denoise", map, "--order", "2", "--sigma", "local:3", "--steps", "4", "--mode", "1",
                 "--scale", "auto"},
                ".rec", {3});
}

TEST_F(Mpi, FindsTheSameEdges) {
    expect_same({"edges", noisy(), "--order", "1", "--time", "0.2", "--threshold", "0.1"}, ".mrc", {2, 5});
}

TEST_F(Mpi, FlowsTheSame) {
    expect_same({"flow", noisy(), "--time", "0.3", "--density-scale", "3", "--threshold", "0.1"}, ".mrc",
                {2, 5});
}

TEST_F(Mpi, TheTimeIsFoundTogether) {
    const std::string map = noisy();
    expect_same({"denoise", map, "--order", "1"}, ".mrc", {2});
    const Ended one = mpi(2, {"denoise", map, at("b.mrc"), "--json"});
    const Json told = Json::parse(one.out, nullptr, false);
    ASSERT_TRUE(told.is_object()) << one.out;
    const Json alone = json({"denoise", map, at("c.mrc")});
    for (const char* key : {"time", "steps", "noise", "removed", "mean_after", "min", "max", "mean", "rms"})
        EXPECT_EQ(told[key], alone[key]) << key;
    EXPECT_EQ(told["members"], 2);
}

TEST_F(Mpi, LeavesPartsThatMerge) {
    const std::string map = noisy();
    const Words how{"--order", "1", "--steps", "6", "--threshold", "0.2", "--quiet"};
    Words alone{"denoise", map, at("one.vdb")}, parts{"denoise", map, at("many.parts")};
    alone.insert(alone.end(), how.begin(), how.end());
    parts.insert(parts.end(), how.begin(), how.end());
    good(alone);
    const Ended r = mpi(4, parts);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(std::distance(fs::directory_iterator(at("many.parts")), fs::directory_iterator()), 4);
    good({"merge", at("many.parts"), at("many.vdb"), "--quiet"});
    EXPECT_TRUE(bytes("many.vdb") == bytes("one.vdb"));
    good({"merge", at("many.parts"), at("many.mrc"), "--quiet"});
    good({"convert", at("one.vdb"), at("one.mrc"), "--quiet"});
    EXPECT_TRUE(bytes("many.mrc") == bytes("one.mrc"));
    // As an input it is read block by block.
    good({"denoise", at("one.vdb"), at("one2.vdb"), "--order", "0", "--steps", "9", "--quiet"});
    good({"denoise", at("many.parts"), at("many2.vdb"), "--order", "0", "--steps", "9", "--quiet"});
    good({"convert", at("one2.vdb"), at("one2.mrc"), "--quiet"});
    good({"convert", at("many2.vdb"), at("many2.mrc"), "--quiet"});
    EXPECT_TRUE(bytes("many2.mrc") == bytes("one2.mrc"));
    // What else is in the folder stays.
    make("many.parts/mine.txt", "mine");
    EXPECT_EQ(mpi(2, parts).code, 0);
    EXPECT_EQ(bytes("many.parts/mine.txt"), "mine");
    EXPECT_EQ(std::distance(fs::directory_iterator(at("many.parts")), fs::directory_iterator()), 3);
    // A part that is missing leaves background; one that is there twice is refused.
    fs::copy(at("many.parts") + "/part_0000.vdb", at("many.parts") + "/part_0007.vdb");
    expect_error(vdbgeo({"merge", at("many.parts"), at("bad.mrc"), "--quiet"}), 3, at("many.parts"),
                 "overlaps");
    expect_error(vdbgeo({"merge", folder_.path().string(), at("bad.mrc"), "--quiet"}), 3,
                 folder_.path().string() + ": no folder of parts");
    EXPECT_FALSE(fs::exists(at("bad.mrc")));
}

TEST_F(Mpi, MapsWithABand) {
    phantom("ball.mrc", 160, {"--snr", "5"});
    good({"convert", at("ball.mrc"), at("shell.vdb"), "--threshold", "0", "--band", "9", "--quiet"});
    ASSERT_LT(json({"info", at("shell.vdb")})["active_voxels"], 160 * 160 * 160 / 2);
    expect_same({"denoise", at("shell.vdb"), "--order", "0", "--steps", "3"}, ".vdb", {2, 5});
    expect_same({"denoise", at("shell.vdb"), "--order", "0", "--steps", "3"}, ".mrc", {2});
    expect_same(
        {"denoise", at("ball.mrc"), "--threshold", "0", "--band", "9", "--order", "1", "--steps", "5"},
        ".vdb", {2});
    expect_same({"edges", at("shell.vdb"), "--order", "0", "--time", "0.2"}, ".vdb", {2});
}

TEST_F(Mpi, ExtractsTheSameSurface) {
    const std::string map = noisy();
    expect_same({"surface", map, "--iso", "1.5sigma"}, ".ply", {1, 2, 4, 5});
    good({"convert", map, at("a.vdb"), "--threshold", "0.5", "--quiet"});
    expect_same({"surface", at("a.vdb"), "--iso", "0.7"}, ".ply", {3});
    // Above a band are tiles that are not active, and the surface depends on them.
    good({"convert", map, at("band.vdb"), "--bin", "2", "--threshold", "0.5", "--band", "0.1", "--quiet"});
    expect_same({"surface", at("band.vdb"), "--iso", "0.5"}, ".ply", {2});
    good({"phantom", "sphere", at("ball.mrc"), "--size", "160", "--quiet"});
    good({"convert", at("ball.mrc"), at("shell.vdb"), "--threshold", "0", "--band", "9", "--quiet"});
    expect_same({"surface", at("shell.vdb"), "--iso", "0"}, ".ply", {2});
    // Its band goes beyond the box, where the surface is closed.
    vdbgeo::write_vdb({vdbgeo::level_set(vdbgeo::read_map(map).map, 1)}, at("ls.vdb"));
    expect_same({"surface", at("ls.vdb")}, ".ply", {2});
    const Ended refused = mpi(2, {"denoise", at("ls.vdb"), at("b.vdb")});
    EXPECT_EQ(refused.code, 3) << refused.err;
    EXPECT_NE(refused.err.find("outside its box"), std::string::npos) << refused.err;
    const Ended r = mpi(2, {"surface", map, at("b.ply"), "--iso", "1", "--json"});
    const Json told = Json::parse(r.out, nullptr, false),
               alone = json({"surface", map, at("c.ply"), "--iso", "1"});
    for (const char* key : {"vertices", "faces", "iso", "method"}) EXPECT_EQ(told[key], alone[key]) << key;
    EXPECT_FALSE(fs::exists(at("b.ply.unfinished")));
}

TEST_F(Mpi, AModelHasTheSameFiles) {
    const std::string map = phantom("a.mrc", 64, {"--snr", "1"}, "atpase");
    const auto words = [&](const std::string& folder, const Words& more) {
        Words all{"model",       map,
                  "-o",          at(folder),
                  "--iso",       "3sigma",
                  "--preset",    "tomogram",
                  "--set",       "denoise.order=1",
                  "--set",       "surface.cap=false",
                  "--width",     "200",
                  "--occlusion", "0",
                  "--json",      "--quiet"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    good(words("one", {}));
    const Ended r = mpi(2, words("two", {}));
    ASSERT_EQ(r.code, 0) << r.err;
    const Json summary = Json::parse(r.out, nullptr, false);
    ASSERT_TRUE(summary.is_object()) << r.out;
    EXPECT_EQ(summary["status"], "done");
    for (const Json& stage : summary["stages"])
        if (stage["name"] == "denoise" || stage["name"] == "surface") {
            EXPECT_EQ(stage["result"]["members"], 2) << stage["name"];
        }
    for (const char* name : {"density.vdb", "smooth.vdb", "surface.ply", "mesh.ply", "curved.ply",
                             "pockets.csv", "tets.vtu", "map.png", "mean.png", "angles.svg"})
        EXPECT_TRUE(bytes(std::string("one/") + name) == bytes(std::string("two/") + name)) << name;
    EXPECT_FALSE(std::filesystem::exists(at("two/spectra.svg")));
    EXPECT_TRUE(std::filesystem::exists(at("two/report.html")));
    EXPECT_EQ(bytes("two/report.html").find("Not in the folder"), std::string::npos);
    // What an earlier run left, and this one does not make, goes.
    EXPECT_TRUE(std::filesystem::exists(at("one/spectra.svg")));
    ASSERT_EQ(mpi(2, words("one", {"--to", "denoise"})).code, 0);
    EXPECT_FALSE(std::filesystem::exists(at("one/spectra.svg")));
    EXPECT_FALSE(std::filesystem::exists(at("one/slices_after_x.png")));
    // What the first alone finds wrong ends all.
    const Ended usage = mpi(2, words("two", {"--from", "tets", "--to", "map"}));
    EXPECT_EQ(usage.code, 2);
    EXPECT_EQ(usage.err, "vdbgeo-mpi: error: --from tets comes after --to map\n");
    const Ended missing = mpi(2, {"model", at("none.mrc"), "-o", at("three"), "--quiet"});
    EXPECT_EQ(missing.code, 4);
    EXPECT_NE(missing.err.find("none.mrc"), std::string::npos) << missing.err;
}

TEST_F(Mpi, OfAModelWhatATeamCannotRunIsRunByTheFirst) {
    const auto model = [&](int processes, const std::string& map, const std::string& folder,
                           const std::string& setting) {
        const Ended r = mpi(processes, {"model", map, "-o", at(folder), "--iso", "0.5sigma", "--to", "surface",
                                        "--set", setting, "--json", "--quiet"});
        ASSERT_EQ(r.code, 0) << r.err;
        const Json summary = Json::parse(r.out, nullptr, false);
        ASSERT_TRUE(summary.is_object()) << r.out;
        for (const Json& stage : summary["stages"]) {
            EXPECT_TRUE(stage["status"] == "done" || stage["status"] == "earlier") << stage;
            if (stage["name"] == "denoise") {
                EXPECT_FALSE(stage["result"].contains("members"));
            }
        }
    };
    model(2, phantom("a.mrc", 48, {"--snr", "1"}, "atpase"), "adi", "denoise.stepper=adi");
    model(3, phantom("b.mrc", 16, {"--snr", "1"}), "f\xFFw", "denoise.order=1");  // three, and two units
}

TEST_F(Mpi, AnErrorIsOneLineAndItsExitCode) {
    const std::string map = phantom("a.mrc", 40);
    const auto expect = [&](int processes, const Words& words, int code, const std::string& text) {
        SCOPED_TRACE(joined(words));
        const Ended r = mpi(processes, words);
        EXPECT_EQ(r.code, code) << r.err;
        const std::size_t found = r.err.find("vdbgeo-mpi: error: ");
        ASSERT_NE(found, std::string::npos) << r.err;
        EXPECT_EQ(r.err.find("vdbgeo-mpi: error: ", found + 1), std::string::npos) << r.err;
        EXPECT_NE(r.err.find(text), std::string::npos) << r.err;
    };
    expect(2, {"denoise", at("none.mrc"), at("b.mrc")}, 4, "none.mrc: cannot be opened");
    expect(2, {"denoise", map, at("b.mrc"), "--order", "99"}, 2, "order 99");
    expect(2, {"denoise", map, at("b.mrc"), "--method", "median"}, 2, "a team runs hyperdiffusion");
    expect(2, {"denoise", map, at("none/b.mrc")}, 4, "there is no folder");
    expect(7, {"denoise", map, at("b.mrc")}, 3, "cannot be shared out to 7");
    expect(2, {"denoise", map, at("b.mrc"), "--threshold", "1e9"}, 5, "no sample is kept");
    expect(2, {"surface", map, at("b.ply"), "--iso", "1e9"}, 5, "no surface at the isovalue");
    expect(2, {"surface", map, at("b.ply"), "--iso", "otsu"}, 2, "a team takes a density");
    expect(2, {"surface", map, at("b.stl"), "--iso", "0"}, 2, "a team writes .ply");
    EXPECT_EQ(listing(), std::set<std::string>{"a.mrc"});
    // The surface is there, but cannot be put in its place.
    const std::string noise = noisy();
    fs::create_directory(at("b.ply"));
    expect(2, {"surface", noise, at("b.ply"), "--iso", "1"}, 4, "b.ply: cannot be written");
    EXPECT_EQ(listing(), (std::set<std::string>{"a.mrc", "b.ply"}));
}

#endif
