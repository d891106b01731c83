// Maps larger than the memory that may be taken, block by block: the same bytes, and the memory is kept to.
#include "tests/cli/cli_test.h"

using namespace vdbgeo::test;

namespace {

namespace fs = std::filesystem;

class Blocks : public Cli {
 protected:
    static constexpr const char* memory = "256M";

    /// 55 MB of noise, which take 280 MB to be denoised in memory.
    std::string noisy() { return phantom("a.mrc", 240, {"--snr", "0.5"}, "atpase"); }

    /// The same command with all the memory and with little of it.
    void expect_same(const Words& words, const std::string& ending) {
        SCOPED_TRACE(joined(words));
        const auto with_out = [&](const std::string& name, const Words& more) {
            Words all = words;
            all.insert(all.begin() + 2, at(name));
            all.insert(all.end(), more.begin(), more.end());
            return all;
        };
        const Json whole = json(with_out("one" + ending, {}));
        Words little = with_out("many" + ending, {"--memory", memory, "--json"});
        const Ended r = good(little);
        const Json blocks = Json::parse(r.out, nullptr, false);
        ASSERT_TRUE(blocks.is_object()) << r.out;
        EXPECT_EQ(whole["blocks"], 0);
        EXPECT_GT(blocks["blocks"].get<int>(), 1);
        for (const char* key : {"time", "steps", "noise", "removed", "mean_before", "mean_after", "min",
                                "max", "mean", "rms", "active_voxels"})
            EXPECT_EQ(blocks.value(key, Json()), whole.value(key, Json())) << key;
        EXPECT_TRUE(bytes("one" + ending) == bytes("many" + ending));
        if (!sanitized) {
            EXPECT_LT(r.peak_bytes, std::uint64_t(256) << 20);
        }
    }
};

}  // namespace

TEST_F(Blocks, DenoiseToTheSameBytes) {
    const std::string map = noisy();
    expect_same({"denoise", map, "--order", "1", "--steps", "12"}, ".mrc");
    expect_same({"denoise", map, "--order", "0", "--sigma", "local", "--steps", "24", "--cycle", "24"},
                ".vdb");
    EXPECT_EQ(listing(), (std::set<std::string>{"a.mrc", "one.mrc", "many.mrc", "one.vdb", "many.vdb"}));
}

TEST_F(Blocks, TheTimeIsFoundAllTheSame) { expect_same({"denoise", noisy(), "--order", "1"}, ".mrc"); }

TEST_F(Blocks, SomeSamplesOnly) {
    const std::string map = noisy();
    expect_same({"denoise", map, "--order", "1", "--steps", "6", "--threshold", "0.5sigma"}, ".vdb");
    expect_same({"denoise", map, "--order", "0", "--steps", "6", "--threshold", "0.2", "--mode", "1",
                 "--scale", "auto"},
                ".mrc");
}

TEST_F(Blocks, FindTheSameEdges) {
    expect_same({"edges", noisy(), "--time", "0.5", "--threshold", "0.1"}, ".mrc");
}

TEST_F(Blocks, FlowTheSame) {
    expect_same({"flow", noisy(), "--time", "0.3", "--density-scale", "3", "--threshold", "0"}, ".mrc");
}

TEST_F(Blocks, WhatNeedsTheWholeMapSaysSo) {
    const std::string map = noisy();
    for (const Words& more : {Words{"--preview", at("p.png")}, Words{"--stepper", "adi", "--time", "1"},
                              Words{"--method", "median"}}) {
        Words words{"denoise", map, at("b.mrc"), "--memory", "150M", "--quiet"};
        words.insert(words.end(), more.begin(), more.end());
        expect_error(vdbgeo(words), 5, map + ": ", "--memory");
    }
    // Less than what the program takes anyway.
    expect_error(vdbgeo({"denoise", map, at("b.mrc"), "--memory", "64M", "--quiet"}), 5, map + ": ",
                 "memory");
    expect_error(
        vdbgeo({"denoise", map, at("b.mrc"), "--memory", memory, "--scratch", at("none"), "--quiet"}), 4,
        at("none"));
    EXPECT_EQ(listing(), std::set<std::string>{"a.mrc"});
}
