// The memory that a command may take is what it takes.
#include <fstream>

#include "tests/cli/cli_test.h"
#include "tests/support/mrc_bytes.h"

using namespace vdbgeo::test;

namespace {

/// A tomogram of 16-bit noise, 640 × 640 × 240: 196 MB, of which nothing compresses.
class Memory : public Cli {
 protected:
    void SetUp() override {
        if (sanitized) GTEST_SKIP() << "a sanitizer's memory is its own";
        MrcBytes bytes;
        bytes.size = {640, 640, 240};
        bytes.mode = 1;
        std::ofstream out(at("big.mrc"), std::ios::binary);
        out << bytes.header();
        std::uint64_t state = 1;
        std::vector<std::int16_t> section(640 * 640);
        for (int z = 0; z < 240; ++z) {
            for (auto& v : section) {
                state = state * 6364136223846793005u + 1442695040888963407u;
                v = static_cast<std::int16_t>(state >> 48);
            }
            out.write(reinterpret_cast<const char*>(section.data()),
                      static_cast<std::streamsize>(2 * section.size()));
        }
    }
};

}  // namespace

TEST_F(Memory, ABudgetHoldsAndChangesNoByte) {
    // As a tree the grid takes 400 MB, packed nearly as much. The runs come first: a child's peak counts from
    // its parent's size.
    const Ended small = good({"convert", at("big.mrc"), at("small.vdb"), "--memory", "128M", "-j", "2"});
    const Ended large = good({"convert", at("big.mrc"), at("large.vdb"), "--memory", "2G", "-j", "2"});
    const Ended back = good({"convert", at("small.vdb"), at("back.mrc"), "-j", "2"});
    const Ended binned =
        good({"convert", at("big.mrc"), at("half.mrc"), "--bin", "2", "--memory", "128M", "-j", "2"});
    const Ended mask = vdbgeo({"convert", at("big.mrc"), at("never.vdb"), "--threshold", "0", "--despeckle",
                               "5", "--memory", "64M", "--quiet", "-j", "2"});
    const Ended selected = good({"convert", at("big.mrc"), at("selected.vdb"), "--threshold", "0",
                                 "--despeckle", "5", "--halo", "1", "--memory", "192M", "-j", "2"});
    EXPECT_LT(small.peak_bytes, 128u << 20);
    EXPECT_NE(small.out.find("went through a temporary file"), std::string::npos) << small.out;
    EXPECT_LT(large.peak_bytes, 2u << 30);
    EXPECT_EQ(large.out.find("temporary"), std::string::npos) << large.out;
    EXPECT_LT(back.peak_bytes, 128u << 20);  // slabs only
    EXPECT_LT(binned.peak_bytes, 128u << 20);
    EXPECT_LT(selected.peak_bytes, 192u << 20);
    expect_error(mask, 5, at("big.mrc"), "--memory");  // told before the memory is gone
    EXPECT_TRUE(bytes("small.vdb") == bytes("large.vdb"));
    EXPECT_TRUE(bytes("back.mrc").substr(1024) == bytes("big.mrc").substr(1024));
}

TEST_F(Memory, ASurfaceInBlocksKeepsToIt) {
    // Whole the grid takes 400 MB; the surface is that of a hundred thousand voxels.
    const auto surface = [this](const std::string& out, const Words& how) {
        Words words{"surface", at("big.mrc"), at(out), "--iso", "32700", "-j", "2"};
        words.insert(words.end(), how.begin(), how.end());
        return good(words);
    };
    const Ended small = surface("small.ply", {"--memory", "96M"});
    const Ended middle = surface("middle.ply", {"--memory", "256M"});
    const Ended whole = surface("whole.ply", {});
    EXPECT_LT(small.peak_bytes, 96u << 20);
    EXPECT_LT(middle.peak_bytes, 256u << 20);
    EXPECT_GT(whole.peak_bytes, 400u << 20);
    EXPECT_NE(small.out.find(" blocks"), std::string::npos) << small.out;
    EXPECT_TRUE(bytes("small.ply") == bytes("whole.ply"));
    EXPECT_TRUE(bytes("middle.ply") == bytes("whole.ply"));
}

TEST_F(Cli, MemorySizesThatAreNoneAreRefused) {
    const std::string map = phantom("a.mrc", 16);
    for (const char* size : {"0", "-1G", "1X", "G", "12", "1M"})
        EXPECT_EQ(vdbgeo({"convert", map, at("never.vdb"), "--memory", size}).code, 2) << size;
    good({"convert", map, at("a.vdb"), "--memory", "0.25G"});
}
