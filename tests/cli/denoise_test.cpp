// vdbgeo denoise: what it writes, says and refuses.
#include <limits>

#include "tests/cli/filter_test.h"
#include "tests/support/mrc_bytes.h"

using namespace vdbgeo::test;

namespace {

class Denoise : public FilterCli {};

const Words keys_of_diffusion{"method",  "order",         "diffusivity", "sigma",      "noise",
                              "removed", "automatic",     "dt",          "steps",      "time",
                              "stepper", "active_voxels", "mean_before", "mean_after", "min",
                              "max",     "mean",          "rms",         "seconds",    "in",
                              "out",     "warnings"};

}  // namespace

TEST_F(Denoise, AloneChoosesAndSaysWhatItChose) {
    const std::string map = noisy("a.mrc", 40);
    const Ended r = good({"denoise", map, at("b.mrc")});
    for (const char* text : {"method      hyperdiffusion, order ", "sigma global", "noise       ",
                             "time        ", "until the noise is gone", "removed     ", "voxels      64000"})
        EXPECT_NE(r.out.find(text), std::string::npos) << text << "\n" << r.out;
    const Json j = json({"denoise", map, at("b.mrc")});
    expect_keys(j, keys_of_diffusion);
    expect_keys(j["seconds"], {"read", "compute", "write"});
    EXPECT_EQ(j["automatic"], true);
    EXPECT_GT(j["noise"], 0.0);
    EXPECT_GT(j["time"], 0.0);
    EXPECT_EQ(j["active_voxels"], 40 * 40 * 40);
    const double before = rms_of_difference(samples("a.mrc"), samples("truth_a.mrc"));
    EXPECT_LT(rms_of_difference(samples("b.mrc"), samples("truth_a.mrc")), 0.6 * before);
}

TEST_F(Denoise, FlagsReachTheOperator) {
    const std::string map = noisy("a.mrc", 24);
    const Json one = json({"denoise", map, at("b.mrc"), "--order", "0,2", "--diffusivity", "1,0.01",
                           "--sigma", "local:3", "--time", "0.7", "--fidelity", "0.1"});
    EXPECT_EQ(one["order"], Json({0, 2}));
    EXPECT_EQ(one["diffusivity"], Json({1.0, 0.01}));
    EXPECT_EQ(one["sigma"], "local:3");
    EXPECT_EQ(one["automatic"], false);
    EXPECT_TRUE(one["noise"].is_null());
    EXPECT_NEAR(one["time"], 0.7, 1e-9);
    const Json euler = json(
        {"denoise", map, at("b.mrc"), "--order", "1", "--steps", "3", "--dt", "0.005", "--stepper", "euler"});
    EXPECT_EQ(euler["steps"], 3);
    EXPECT_EQ(euler["dt"], 0.005);
    EXPECT_EQ(euler["stepper"], "euler");
    EXPECT_NEAR(euler["time"], 0.015, 1e-12);
    const Json all = json({"denoise", map, at("b.mrc"), "--sigma", "inf", "--time", "1"});
    EXPECT_EQ(all["sigma"], "inf");
    // Perona–Malik is order 0.
    good({"denoise", map, at("c.mrc"), "--method", "perona-malik", "--time", "1", "--quiet"});
    good({"denoise", map, at("d.mrc"), "--order", "0", "--time", "1", "--quiet"});
    EXPECT_EQ(samples("c.mrc"), samples("d.mrc"));
}

TEST_F(Denoise, NoTimeGivesTheSamplesBack) {
    const std::string map = noisy("a.mrc", 20);
    for (const Words& how : {Words{"--time", "0"}, Words{"--method", "median", "--radius", "0"},
                             Words{"--method", "gaussian", "--blur", "0"}}) {
        Words words{"denoise", map, at("b.mrc"), "--quiet"};
        words.insert(words.end(), how.begin(), how.end());
        good(words);
        EXPECT_EQ(samples("b.mrc"), samples("a.mrc")) << how.back();
    }
}

TEST_F(Denoise, KeepsTheFrameAndTheFactsOfTheHeader) {
    MrcBytes map;
    map.size = {12, 10, 9};
    map.mode = 1;
    map.axes = {2, 1, 3};
    map.start = {-3, 5, 7};
    map.voxel = {1.5f, 1.5f, 1.5f};
    const std::string in = make("a.mrc", map.str());
    const Json done = json({"denoise", in, at("b.mrc"), "--time", "1"});
    const Json before = json({"info", in}), after = json({"info", at("b.mrc")});
    for (const char* key :
         {"nx", "ny", "nz", "voxel_size_A", "origin_A", "axis_order", "nstart", "space_group"})
        EXPECT_EQ(after[key], before[key]) << key;
    EXPECT_EQ(before["mode"], 1);
    EXPECT_EQ(after["mode"], 2);  // means are no whole numbers
    for (const char* key : {"min", "max", "mean", "rms"}) {
        EXPECT_NEAR(done[key], after[key], 1e-5) << key;
        EXPECT_NEAR(after["header_statistics"][key], after[key], 1e-5) << key;
    }
    EXPECT_NEAR(after["mean"], before["mean"], 1e-5);
    EXPECT_LT(after["rms"], before["rms"]);
}

TEST_F(Denoise, TheGridRemembersWhatWasDone) {
    const std::string map = noisy("a.mrc", 20);
    good({"denoise", map, at("b.vdb"), "--order", "1", "--time", "0.25", "--quiet"});
    const std::string all = json({"info", at("b.vdb")}).dump();
    for (const char* text : {"denoised: hyperdiffusion", "order 1", "time 0.25", "sigma global"})
        EXPECT_NE(all.find(text), std::string::npos) << text << "\n" << all;
    // Through VDB or not, the samples are the same.
    good({"denoise", map, at("c.mrc"), "--order", "1", "--time", "0.25", "--quiet"});
    good({"convert", at("b.vdb"), at("d.mrc"), "--quiet"});
    EXPECT_EQ(samples("c.mrc"), samples("d.mrc"));
}

TEST_F(Denoise, ABandStaysABand) {
    const std::string map = noisy("a.mrc", 32, "10");
    good({"convert", map, at("a.vdb"), "--threshold", "1sigma", "--quiet"});
    good({"denoise", at("a.vdb"), at("b.vdb"), "--time", "2", "--quiet"});
    good({"denoise", map, at("c.vdb"), "--threshold", "1sigma", "--time", "2", "--quiet"});
    const Json a = json({"info", at("a.vdb")}), b = json({"info", at("b.vdb")}),
               c = json({"info", at("c.vdb")});
    EXPECT_LT(a["active_voxels"], 32 * 32 * 32 / 2);
    for (const Json& j : {b, c}) {
        EXPECT_EQ(j["active_voxels"], a["active_voxels"]);
        EXPECT_EQ(j["background"], a["background"]);
    }
    // What was dropped is as it was; the statistics are those of the samples as they read now.
    for (const char* name : {"a", "b", "c"})
        good({"convert", at(std::string(name) + ".vdb"), at(std::string(name) + "2.mrc"), "--quiet"});
    EXPECT_EQ(samples("b2.mrc"), samples("c2.mrc"));
    const auto before = samples("a2.mrc"), after = samples("b2.mrc");
    const float background = a["background"].get<float>();
    int changed = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
        if (before[i] == background) {
            EXPECT_EQ(after[i], background);
        }
        changed += before[i] != after[i];
    }
    EXPECT_GT(changed, 100);
    EXPECT_NEAR(b["mean"], json({"info", at("b2.mrc")})["mean"], 1e-6);
    EXPECT_NEAR(b["rms"], json({"info", at("b2.mrc")})["rms"], 1e-6);
}

TEST_F(Denoise, Baselines) {
    const std::string map = noisy("a.mrc", 28);
    const double before = rms_of_difference(samples("a.mrc"), samples("truth_a.mrc"));
    for (const auto& [method, key] :
         {std::pair("gaussian", "blur"), {"median", "radius"}, {"bilateral", "range"}}) {
        SCOPED_TRACE(method);
        const Json j = json({"denoise", map, at("b.mrc"), "--method", method});
        EXPECT_EQ(j["method"], method);
        expect_keys(j, {key, "noise", "removed", "automatic", "active_voxels", "mean_before", "mean_after"});
        EXPECT_LT(rms_of_difference(samples("b.mrc"), samples("truth_a.mrc")), 0.8 * before);
        EXPECT_NEAR(j["removed"], rms_of_difference(samples("b.mrc"), samples("a.mrc")), 1e-6);
        const Ended r = good({"denoise", map, at("b.mrc"), "--method", method});
        EXPECT_NE(r.out.find(std::string("method      ") + method), std::string::npos) << r.out;
    }
    EXPECT_EQ(json({"denoise", map, at("b.mrc"), "--method", "bilateral", "--range", "0.5"})["range"], 0.5);
}

TEST_F(Denoise, NonsenseIsTwo) {
    const std::string map = phantom("a.mrc", 16), out = at("b.mrc");
    const auto before = listing();
    const std::vector<Words> bad{{"--order", "x"},
                                 {"--order", "-1"},
                                 {"--order", "16"},
                                 {"--order", "1,1"},
                                 {"--order", "1,"},
                                 {"--order", "0.5"},
                                 {"--diffusivity", "0"},
                                 {"--diffusivity", "1,2"},
                                 {"--diffusivity", "nan"},
                                 {"--sigma", "0"},
                                 {"--sigma", "local:9"},
                                 {"--sigma", "much"},
                                 {"--time", "-1"},
                                 {"--time", "long"},
                                 {"--time", "1", "--steps", "2"},
                                 {"--steps", "-1"},
                                 {"--dt", "0"},
                                 {"--stepper", "magic"},
                                 {"--cycle", "0"},
                                 {"--fidelity", "-1"},
                                 {"--method", "magic"},
                                 {"--method", "gaussian", "--order", "1"},
                                 {"--method", "gaussian", "--radius", "1"},
                                 {"--method", "gaussian", "--blur", "99"},
                                 {"--method", "median", "--sigma", "1"},
                                 {"--method", "median", "--blur", "1"},
                                 {"--method", "median", "--radius", "9"},
                                 {"--method", "bilateral", "--range", "0"},
                                 {"--method", "perona-malik", "--order", "1"},
                                 {"--blur", "1"},
                                 {"--radius", "1"},
                                 {"--range", "1"},
                                 {"--preview", at("b.jpg")},
                                 {"--memory", "lots"}};
    for (const Words& flags : bad) {
        Words words{"denoise", map, out};
        words.insert(words.end(), flags.begin(), flags.end());
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 2, "");
    }
    expect_error(vdbgeo({"denoise", map}), 2, "");
    expect_error(vdbgeo({"denoise", map, at("b.ply")}), 2, at("b.ply") + ": ");
    expect_error(vdbgeo({"denoise", at("none.mrc"), out, "--sigma", "x"}), 2, "--sigma: ");
    expect_error(vdbgeo({"denoise", at("none.mrc"), out}), 4, at("none.mrc") + ": ");
    EXPECT_EQ(listing(), before);
}

TEST_F(Denoise, AStepAboveTheBoundIsThree) {
    const std::string map = phantom("a.mrc", 16);
    const Ended r = vdbgeo({"denoise", map, at("b.mrc"), "--steps", "3", "--dt", "0.5", "--quiet"});
    expect_error(r, 3, map + ": ", "0.0138889");  // 2/12²
    EXPECT_FALSE(listing().count("b.mrc"));
}

TEST_F(Denoise, SamplesThatAreNoNumbersAreThree) {
    MrcBytes map;
    map.size = {9, 8, 10};
    map.values.assign(720, 1.0);
    map.values[300] = std::numeric_limits<double>::quiet_NaN();
    map.values[301] = std::numeric_limits<double>::infinity();
    const std::string in = make("a.mrc", map.str());
    for (const char* method : {"hyperdiffusion", "gaussian", "median", "bilateral"})
        expect_error(vdbgeo({"denoise", in, at("b.mrc"), "--method", method, "--quiet"}), 3, in + ": ",
                     "2 of the samples are not finite");
    EXPECT_FALSE(listing().count("b.mrc"));
    good({"denoise", in, at("b.mrc"), "--threshold", "0", "--time", "1", "--quiet"});
}

TEST_F(Denoise, TooLittleMemoryAndNothingKeptAreFive) {
    const std::string map = phantom("a.mrc", 152);  // 71 MB of grid and state
    expect_error(vdbgeo({"denoise", map, at("b.mrc"), "--memory", "64M", "--time", "1"}), 5, map + ": ",
                 "--bin");
    expect_error(vdbgeo({"denoise", map, at("b.mrc"), "--threshold", "1e9", "--quiet"}), 5, map + ": ",
                 "no sample is kept");
    good({"convert", map, at("a.vdb"), "--quiet"});
    expect_error(vdbgeo({"denoise", at("a.vdb"), at("b.mrc"), "--memory", "64M", "--time", "1", "--quiet"}),
                 5, at("a.vdb") + ": ", "--memory");
    EXPECT_FALSE(listing().count("b.mrc"));
    // Fewer voxels fit.
    good({"denoise", map, at("b.mrc"), "--memory", "64M", "--time", "1", "--bin", "2"});
    good({"denoise", map, at("b.mrc"), "--memory", "64M", "--time", "1", "--crop", "0:16,0:16,:20"});
    good({"denoise", map, at("b.mrc"), "--memory", "64M", "--time", "1", "--keep-fraction", "0.01"});
}

TEST_F(Denoise, ALevelSetIsThree) {
    const std::string map = phantom("a.mrc", 24);
    good({"convert", map, at("s.vdb"), "--grids", "surface", "--iso", "0", "--quiet"});
    expect_error(vdbgeo({"denoise", at("s.vdb"), at("b.vdb"), "--grid", "surface", "--quiet"}), 3,
                 at("s.vdb") + ": ", "level set");
}

TEST_F(Denoise, PreviewShowsBeforeAndAfter) {
    const std::string map = noisy("a.mrc", 32);
    const Json j = json({"denoise", map, at("b.mrc"), "--time", "2", "--preview", at("b.png")});
    EXPECT_EQ(j["preview"], at("b.png"));
    expect_picture("b.png");
    good({"denoise", map, at("c.mrc"), "--time", "2", "--quiet"});
    EXPECT_EQ(bytes("b.mrc"), bytes("c.mrc"));
    expect_error(
        vdbgeo({"denoise", map, at("b.mrc"), "--time", "1", "--quiet", "--preview", at("none/b.png")}), 4,
        at("none/b.png") + ": ");
}

TEST_F(Denoise, PreviewOfFlatAndOfSparseMaps) {
    MrcBytes picture;
    picture.size = {20, 30, 1};
    good({"denoise", make("a.mrc", picture.str()), at("b.mrc"), "--time", "1", "--preview", at("a.png"),
          "--quiet"});
    expect_picture("a.png");
    MrcBytes flat;
    flat.size = {8, 8, 8};
    flat.values.assign(512, 7.0);
    good({"denoise", make("f.mrc", flat.str()), at("b.mrc"), "--time", "1", "--preview", at("f.png"),
          "--quiet"});
    EXPECT_GT(bytes("f.png").size(), 1000u);
    const std::string map = noisy("c.mrc", 32, "10");
    good({"denoise", map, at("b.vdb"), "--threshold", "1sigma", "--time", "1", "--preview", at("c.png"),
          "--quiet"});
    expect_picture("c.png");
}

TEST_F(Denoise, SameBytesForAnyNumberOfThreads) {
    const std::string map = noisy("a.mrc", 40);
    expect_same_bytes({"denoise", map, at("b.mrc"), "--preview", at("b.png")}, {"b.mrc", "b.png"});
    expect_same_bytes({"denoise", map, at("b.vdb"), "--order", "1", "--threshold", "1sigma"}, {"b.vdb"});
    for (const char* method : {"gaussian", "median", "bilateral"})
        expect_same_bytes({"denoise", map, at("b.mrc"), "--method", method}, {"b.mrc"});
}

TEST_F(Denoise, FromAndToAPipe) {
    const std::string map = noisy("a.mrc", 20);
    good({"denoise", map, at("b.mrc"), "--time", "1", "--quiet"});
    RunOptions pipe;
    pipe.input = map;
    EXPECT_EQ(good({"denoise", "-", "-", "--time", "1", "--quiet"}, pipe).out.substr(1024),
              bytes("b.mrc").substr(1024));
    expect_error(vdbgeo({"denoise", map, "-", "--json"}), 2, "-: ");
}

TEST_F(Denoise, InterruptedItLeavesNothing) {
    const std::string map = noisy("a.mrc", 64);
    RunOptions options;
    options.signal = SIGINT;
    options.signal_heard = true;
    options.signal_at = "reading";
    const Ended r = vdbgeo({"denoise", map, at("b.mrc"), "--order", "1", "--steps", "2000"}, options);
    EXPECT_EQ(r.code, 130) << r.err;
    EXPECT_NE(r.err.find("vdbgeo: error: interrupted"), std::string::npos) << r.err;
    EXPECT_FALSE(listing().count("b.mrc"));
}
