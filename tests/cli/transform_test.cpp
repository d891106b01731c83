// vdbgeo transform: what it writes, says and refuses.
#include "tests/cli/filter_test.h"

using namespace vdbgeo::test;

namespace {

class Transform : public FilterCli {
 protected:
    std::vector<float> sum_of(const Words& names) const {
        std::vector<float> sum;
        for (const std::string& name : names) {
            const auto values = samples(name);
            sum.resize(values.size());
            for (std::size_t i = 0; i < values.size(); ++i) sum[i] += values[i];
        }
        return sum;
    }
};

const Words all_files{"t_mode_1.mrc", "t_mode_2.mrc", "t_mode_3.mrc", "t_residue.mrc"};

}  // namespace

TEST_F(Transform, ModesAndResidueAddUpToTheMap) {
    const std::string map = noisy("a.mrc", 32);
    const Json j = json({"transform", map, at("t"), "--preview", at("t.png")});
    ASSERT_EQ(j["modes"].size(), 4u);
    for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_EQ(j["modes"][k]["file"], at(all_files[k]));
        expect_keys(j["modes"][k], {"name", "min", "max", "mean", "rms"});
    }
    expect_keys(j["modes"][0], {"order", "time", "dt", "steps"});
    expect_keys(j, {"sigma", "stepper", "active_voxels", "seconds"});
    const auto in = samples("a.mrc");
    const auto [low, high] = std::minmax_element(in.begin(), in.end());
    EXPECT_LT(largest_difference(sum_of(all_files), in), 1e-6 * double(*high - *low));
    expect_picture("t.png");
    for (const auto& name : listing()) EXPECT_EQ(name.find(".vdbgeo"), std::string::npos);
}

TEST_F(Transform, AddUpWhereSamplesWereDroppedToo) {
    const std::string map = noisy("a.mrc", 32, "10");
    good({"convert", map, at("a.vdb"), "--threshold", "1sigma", "--quiet"});
    good({"transform", at("a.vdb"), at("t"), "--orders", "0,2", "--times", "0.5,2", "--quiet"});
    for (const char* name : {"a", "t_mode_1", "t_mode_2", "t_residue"})
        good({"convert", at(std::string(name) + ".vdb"), at(std::string(name) + "_back.mrc"), "--quiet"});
    EXPECT_LT(largest_difference(sum_of({"t_mode_1_back.mrc", "t_mode_2_back.mrc", "t_residue_back.mrc"}),
                                 samples("a_back.mrc")),
              1e-5);
}

TEST_F(Transform, SomeModesAreOneMap) {
    const std::string map = noisy("a.mrc", 24);
    good({"transform", map, at("t"), "--quiet"});
    const Json j = json({"transform", map, at("b.mrc"), "--keep", "1,3", "--preview", at("b.png")});
    EXPECT_EQ(j["out"], at("b.mrc"));
    EXPECT_EQ(j["modes"][0]["kept"], true);
    EXPECT_EQ(j["modes"][1]["kept"], false);
    EXPECT_LT(largest_difference(samples("b.mrc"), sum_of({"t_mode_1.mrc", "t_mode_3.mrc"})), 1e-6);
    good({"transform", map, at("c.mrc"), "--keep", "residue,2", "--quiet"});
    EXPECT_LT(largest_difference(samples("c.mrc"), sum_of({"t_mode_2.mrc", "t_residue.mrc"})), 1e-6);
    good({"transform", map, at("d.mrc"), "--keep", "1,2,3,residue", "--quiet"});
    EXPECT_LT(largest_difference(samples("d.mrc"), samples("a.mrc")), 1e-5);
}

// A band from time LOW to HIGH: what is left after LOW, less what is left when that goes on to HIGH.
TEST_F(Transform, ABandByOrderAndTime) {
    const std::string map = noisy("a.mrc", 24);
    good({"transform", map, at("b.mrc"), "--band-pass", "0.5:4", "--orders", "0", "--quiet"});
    const auto low_pass = [&](const std::string& in, const std::string& out, const char* time) {
        good({"denoise", in, at(out), "--order", "0", "--sigma", "inf", "--time", time, "--quiet"});
    };
    low_pass(map, "low.mrc", "0.5");
    low_pass(at("low.mrc"), "high.mrc", "3.5");
    auto band = samples("low.mrc");
    const auto high = samples("high.mrc");
    for (std::size_t i = 0; i < band.size(); ++i) band[i] -= high[i];
    const double size = rms_of_difference(band, std::vector<float>(band.size()));
    EXPECT_GT(size, 0.01);
    EXPECT_LT(largest_difference(samples("b.mrc"), band), 1e-4 * size);
}

TEST_F(Transform, FormatsByEndingFlagAndInput) {
    const std::string map = noisy("a.mrc", 16);
    good({"transform", map, at("u.vdb"), "--times", "1", "--orders", "1", "--quiet"});
    EXPECT_TRUE(listing().count("u_mode_1.vdb") && listing().count("u_residue.vdb"));
    good({"transform", at("u_residue.vdb"), at("v"), "--times", "1", "--quiet"});
    EXPECT_TRUE(listing().count("v_mode_1.vdb"));
    good({"transform", map, at("w"), "--format", "map", "--times", "1", "--quiet"});
    EXPECT_TRUE(listing().count("w_mode_1.map"));
    good({"transform", map, at("x.mrc.gz"), "--times", "1", "--quiet"});
    EXPECT_EQ(json({"info", at("x_mode_1.mrc.gz")})["nx"], 16);
    EXPECT_EQ(bytes("x_mode_1.mrc.gz").substr(0, 2), "\x1f\x8b");
}

TEST_F(Transform, AllFilesOrNone) {
    const std::string map = noisy("a.mrc", 16);
    std::filesystem::create_directory(at("t_residue.mrc"));
    const auto before = listing();
    expect_error(vdbgeo({"transform", map, at("t"), "--quiet"}), 4, at("t_residue.mrc") + ": ");
    expect_error(vdbgeo({"transform", map, at("none/t"), "--quiet"}), 4, at("none/t"));
    EXPECT_EQ(listing(), before);
}

TEST_F(Transform, Errors) {
    const std::string map = phantom("a.mrc", 16);
    const auto before = listing();
    for (const Words& flags : std::vector<Words>{{"--orders", "1,2"},
                                                 {"--orders", "99"},
                                                 {"--times", "-1"},
                                                 {"--times", "1,x"},
                                                 {"--orders", "1,2", "--times", "1,2,3"},
                                                 {"--keep", "0"},
                                                 {"--keep", "4"},
                                                 {"--keep", "1,"},
                                                 {"--keep", "fine"},
                                                 {"--band-pass", "2"},
                                                 {"--band-pass", "2:1"},
                                                 {"--band-pass", "-1:1"},
                                                 {"--band-pass", "1:2:3"},
                                                 {"--band-pass", "1:2", "--keep", "1"},
                                                 {"--band-pass", "1:2", "--times", "1"},
                                                 {"--format", "ply"},
                                                 {"--sigma", "x"}}) {
        Words words{"transform", map, at("t")};
        words.insert(words.end(), flags.begin(), flags.end());
        SCOPED_TRACE(joined(words));
        expect_error(vdbgeo(words), 2, "");
    }
    expect_error(vdbgeo({"transform", map, at("t.vdb"), "--format", "mrc"}), 2, at("t.vdb") + ": ");
    expect_error(vdbgeo({"transform", map, "-"}), 2, "-: ");
    EXPECT_EQ(listing(), before);
}

TEST_F(Transform, TooLittleMemoryIsFive) {
    const std::string map = phantom("a.mrc", 136);
    expect_error(vdbgeo({"transform", map, at("t"), "--memory", "64M"}), 5, map + ": ", "--bin 2");
    EXPECT_EQ(listing().size(), 1u);
}

TEST_F(Transform, SameBytesForAnyNumberOfThreads) {
    const std::string map = noisy("a.mrc", 32);
    expect_same_bytes({"transform", map, at("t")}, all_files);
}
