// The same bytes whatever the number of threads, and from one run to the next.
#include <map>

#include "tests/cli/cli_test.h"

using namespace vdbgeo::test;

namespace {

class Threads : public Cli {
 protected:
    /// Runs the command with 1, 2, 7 and all threads and compares what it wrote to `out`.
    void expect_same(const Words& words, const std::string& out) {
        std::string first;
        for (const char* threads : {"1", "2", "7", ""}) {
            SCOPED_TRACE(joined(words) + "threads " + threads);
            Words full = words;
            if (*threads) full.insert(full.end(), {"--threads", threads});
            std::filesystem::remove(folder_ / out);
            good(full);
            const std::string found = bytes(out);
            EXPECT_GT(found.size(), 100u);
            if (first.empty()) first = found;
            EXPECT_TRUE(found == first);
        }
    }
};

}  // namespace

TEST_F(Threads, Phantom) {
    for (const char* kind : {"torus", "atpase"})
        expect_same({"phantom", kind, at("p.mrc"), "--size", "48", "--snr", "2", "--seed", "7"}, "p.mrc");
}

TEST_F(Threads, ConvertSurfaceRender) {
    const std::string map = phantom("a.mrc", 72, {"--snr", "2"}, "baseplate");
    expect_same({"convert", map, at("a.vdb")}, "a.vdb");
    expect_same({"convert", map, at("b.vdb"), "--threshold", "1sigma", "--compression", "zip"}, "b.vdb");
    expect_same({"convert", at("b.vdb"), at("b.mrc")}, "b.mrc");
    expect_same({"surface", map, at("a.ply"), "--iso", "0.5"}, "a.ply");
    expect_same({"surface", at("b.vdb"), at("b.stl"), "--iso", "0.5"}, "b.stl");
    expect_same({"render", at("a.ply"), at("a.png"), "--width", "200", "--occlusion", "4"}, "a.png");
}

TEST_F(Threads, Model) {
    const std::string map = phantom("a.mrc", 48, {"--snr", "4"}, "virus");
    std::map<std::string, std::string> first;
    for (const char* threads : {"1", "2", "7"}) {
        good({"model", map, "-o", at("m"), "--iso", "0.5", "--width", "200", "--occlusion", "2", "--fresh",
              "--threads", threads});
        std::map<std::string, std::string> found;
        for (const auto& entry : std::filesystem::directory_iterator(folder_ / "m"))
            if (entry.path().filename() != "summary.json" && entry.path().filename() != "report.html")
                found[entry.path().filename().string()] = read_bytes(entry.path());
        EXPECT_GE(found.size(), 3u);
        if (first.empty()) first = found;
        EXPECT_TRUE(found == first) << threads;
    }
    // Those two tell the seconds; a page of one and the same run does not change.
    std::string page;
    for (const char* threads : {"1", "2", "7"}) {
        good({"report", at("m"), "-o", at("page.html"), "--threads", threads});
        if (page.empty()) page = bytes("page.html");
        EXPECT_TRUE(bytes("page.html") == page) << threads;
    }
}
