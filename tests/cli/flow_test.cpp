// vdbgeo flow: of densities and of surfaces.
#include "tests/cli/filter_test.h"

using namespace vdbgeo::test;

namespace {

class Flow : public FilterCli {};

}  // namespace

TEST_F(Flow, OfADensity) {
    const std::string map = noisy("a.mrc", 28);
    const Json j = json({"flow", map, at("b.mrc"), "--order", "0", "--time", "2", "--preview", at("b.png")});
    expect_keys(
        j, {"flow", "order", "fidelity", "pressure", "density_scale", "dt", "steps", "time", "active_voxels",
            "mean_before", "mean_after", "removed", "min", "max", "mean", "rms", "seconds"});
    EXPECT_EQ(j["flow"], "density");
    EXPECT_NEAR(j["time"], 2.0, 1e-6);
    EXPECT_GT(j["removed"], 0.0);
    EXPECT_LT(rms_of_difference(samples("b.mrc"), samples("truth_a.mrc")),
              rms_of_difference(samples("a.mrc"), samples("truth_a.mrc")));
    expect_picture("b.png");
    good({"flow", map, at("c.mrc"), "--time", "0", "--quiet"});
    EXPECT_EQ(samples("c.mrc"), samples("a.mrc"));
    EXPECT_NE(good({"flow", map, at("b.mrc")}).out.find("flow        of the density"), std::string::npos);
}

TEST_F(Flow, ASphereShrinksByItsMeanCurvature) {
    const std::string map = phantom("a.mrc", 48, {"--voxel-size", "2", "--radius", "24"});
    const Words flow{"flow", map, at("b.vdb"), "--surface", "mean-curvature", "--iso", "0", "--time", "10"};
    const Json j = json(flow);
    expect_keys(j, {"flow", "iso", "dt", "steps", "time", "active_voxels", "volume_before_A3",
                    "volume_after_A3", "seconds"});
    // R² = R0² − 4t in voxels: 12² − 40.
    const double pi = 3.14159265358979;
    EXPECT_NEAR(j["volume_before_A3"], 4 * pi / 3 * 24 * 24 * 24, 0.01 * 4 * pi / 3 * 24 * 24 * 24);
    EXPECT_NEAR(std::cbrt(j["volume_after_A3"].get<double>() * 3 / (4 * pi)), 2 * std::sqrt(104.0), 0.3);
    EXPECT_EQ(json({"info", at("b.vdb")})["class"], "level set");
    // A level set goes on from where it is.
    const Json more = json({"flow", at("b.vdb"), at("c.vdb"), "--surface", "mean-curvature", "--time", "5"});
    EXPECT_FALSE(more.contains("iso"));
    EXPECT_NEAR(more["volume_before_A3"], j["volume_after_A3"], 0.01 * j["volume_after_A3"].get<double>());
    EXPECT_LT(more["volume_after_A3"], more["volume_before_A3"]);
    EXPECT_NE(good(flow).out.find("volume      "), std::string::npos);
    expect_error(vdbgeo({"flow", map, at("d.vdb"), "--surface", "mean-curvature", "--iso", "0", "--time",
                         "1000", "--quiet"}),
                 5, map + ": ", "nothing is left");
    EXPECT_FALSE(listing().count("d.vdb"));
}

TEST_F(Flow, FourthOrderFlowsKeepASphere) {
    const std::string map = phantom("a.mrc", 40, {"--voxel-size", "1", "--radius", "10"});
    for (const char* kind : {"surface-diffusion", "willmore"}) {
        const Json j = json({"flow", map, at("b.vdb"), "--surface", kind, "--iso", "0", "--time", "3"});
        EXPECT_EQ(j["flow"], kind);
        EXPECT_NEAR(j["volume_after_A3"], j["volume_before_A3"], 0.02 * j["volume_before_A3"].get<double>())
            << kind;
    }
}

TEST_F(Flow, Errors) {
    const std::string map = phantom("a.mrc", 16);
    const auto before = listing();
    for (const Words& flags : std::vector<Words>{{"--order", "-1"},
                                                 {"--order", "8"},
                                                 {"--time", "-1"},
                                                 {"--density-scale", "0"},
                                                 {"--iso", "1"},
                                                 {"--half-width", "4"},
                                                 {"--surface", "flat"},
                                                 {"--surface", "willmore", "--order", "1"},
                                                 {"--surface", "willmore", "--pressure", "1"},
                                                 {"--surface", "willmore", "--iso", "x"},
                                                 {"--surface", "willmore", "--time", "-1"}}) {
        Words words{"flow", map, at("b.vdb")};
        words.insert(words.end(), flags.begin(), flags.end());
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 2, "");
    }
    expect_error(vdbgeo({"flow", map, at("b.vdb"), "--dt", "9", "--quiet"}), 3, map + ": ");
    expect_error(vdbgeo({"flow", map, at("b.vdb"), "--surface", "willmore", "--iso", "1e9", "--quiet"}), 5,
                 map + ": ");
    EXPECT_EQ(listing(), before);
    good({"convert", map, at("s.vdb"), "--grids", "surface", "--iso", "0", "--quiet"});
    expect_error(vdbgeo({"flow", at("s.vdb"), at("b.vdb"), "--grid", "surface", "--quiet"}), 3,
                 at("s.vdb") + ": ", "level set");
}

TEST_F(Flow, TooLittleMemoryIsFive) {
    const std::string map = phantom("a.mrc", 168);
    expect_error(vdbgeo({"flow", map, at("b.vdb"), "--memory", "64M"}), 5, map + ": ", "--bin 2");
    EXPECT_EQ(listing().size(), 1u);
}

TEST_F(Flow, SameBytesForAnyNumberOfThreads) {
    const std::string map = noisy("a.mrc", 28, "4");
    expect_same_bytes({"flow", map, at("b.mrc"), "--time", "1"}, {"b.mrc"});
    expect_same_bytes(
        {"flow", map, at("b.vdb"), "--surface", "mean-curvature", "--iso", "0.5", "--time", "1"}, {"b.vdb"});
}
