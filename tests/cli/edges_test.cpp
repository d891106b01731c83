// vdbgeo edges: what it writes, says and refuses.
#include "tests/cli/filter_test.h"

using namespace vdbgeo::test;

namespace {

class Edges : public FilterCli {};

}  // namespace

TEST_F(Edges, LieWhereTheDensityChanges) {
    const std::string map = phantom("a.mrc", 32);
    const Json j =
        json({"edges", map, at("b.mrc"), "--time", "3", "--sigma", "inf", "--preview", at("b.png")});
    expect_keys(
        j, {"order", "slow", "fast", "coupling_u", "coupling_v", "sigma", "dt", "steps", "time", "stepper",
            "active_voxels", "mean_before", "mean_after", "min", "max", "mean", "rms", "seconds"});
    EXPECT_EQ(j["active_voxels"], 32 * 32 * 32);
    EXPECT_GT(j["rms"], 0.0);
    EXPECT_NEAR(j["mean"], 0.0, 1e-4 * j["rms"].get<double>());
    expect_picture("b.png");
    EXPECT_NE(good({"edges", map, at("b.mrc")}).out.find("edges       "), std::string::npos);
}

TEST_F(Edges, EqualDiffusionsHaveNone) {
    const std::string map = noisy("a.mrc", 20);
    good({"edges", map, at("b.mrc"), "--slow", "1", "--fast", "1", "--quiet"});
    for (const float v : samples("b.mrc")) ASSERT_EQ(v, 0.0f);
    // What was dropped has no edges either.
    good({"edges", map, at("c.vdb"), "--threshold", "1sigma", "--time", "2", "--quiet"});
    EXPECT_EQ(json({"info", at("c.vdb")})["background"], 0.0);
    good({"convert", at("c.vdb"), at("c.mrc"), "--quiet"});
    std::size_t zeros = 0;
    for (const float v : samples("c.mrc")) zeros += v == 0;
    EXPECT_GE(zeros, 20u * 20 * 20 - json({"info", at("c.vdb")})["active_voxels"].get<std::size_t>());
}

TEST_F(Edges, FlagsReachTheOperator) {
    const std::string map = noisy("a.mrc", 20);
    const Json j =
        json({"edges", map, at("b.mrc"), "--order", "1", "--slow", "0.1", "--fast", "0.5", "--coupling",
              "0.1,0.2", "--sigma", "global", "--time", "0.3", "--stepper", "euler"});
    EXPECT_EQ(j["order"], 1);
    EXPECT_EQ(j["slow"], 0.1);
    EXPECT_EQ(j["fast"], 0.5);
    EXPECT_EQ(j["coupling_u"], 0.1);
    EXPECT_EQ(j["coupling_v"], 0.2);
    EXPECT_EQ(j["sigma"], "global");
    EXPECT_EQ(j["stepper"], "euler");
    EXPECT_NEAR(j["time"], 0.3, 1e-9);
}

TEST_F(Edges, Errors) {
    const std::string map = phantom("a.mrc", 16);
    const auto before = listing();
    for (const Words& flags : std::vector<Words>{{"--order", "-1"},
                                                 {"--slow", "-1"},
                                                 {"--slow", "2", "--fast", "1"},
                                                 {"--coupling", "-1"},
                                                 {"--coupling", "1,2,3"},
                                                 {"--coupling", "x"},
                                                 {"--sigma", "x"},
                                                 {"--time", "-1"},
                                                 {"--dt", "-1"},
                                                 {"--stepper", "x"}}) {
        Words words{"edges", map, at("b.mrc")};
        words.insert(words.end(), flags.begin(), flags.end());
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 2, "");
    }
    expect_error(vdbgeo({"edges", map, at("b.mrc"), "--dt", "9", "--quiet"}), 3, map + ": ");
    EXPECT_EQ(listing(), before);
}

TEST_F(Edges, TooLittleMemoryIsFive) {
    const std::string map = phantom("a.mrc", 136);
    expect_error(vdbgeo({"edges", map, at("b.mrc"), "--memory", "64M"}), 5, map + ": ", "--bin 2");
    EXPECT_EQ(listing().size(), 1u);
}

TEST_F(Edges, SameBytesForAnyNumberOfThreads) {
    const std::string map = noisy("a.mrc", 32);
    expect_same_bytes({"edges", map, at("b.mrc")}, {"b.mrc"});
}
