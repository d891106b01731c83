// Headers that lie, each in one respect: every command that reads maps refuses them by that fault, with exit
// code 3, in one line, with little memory, and writes nothing.
#include <cmath>

#include "tests/cli/cli_test.h"
#include "tests/cli/small_memory.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/pack.h"

using namespace vdbgeo::test;

namespace {

struct Defect {
    std::string name, bytes, text;
};

MrcBytes with(const std::vector<std::pair<int, std::int32_t>>& words) {
    MrcBytes map;
    for (const auto& [word, value] : words) map.set(word, value);
    return map;
}

std::string with_float(int word, float value) {
    MrcBytes map;
    map.set(word, value);
    return map.str();
}

/// A map of 10^9 bytes by its header, with 1 KB of them.
std::string lie(bool scaled_down = false) {
    MrcBytes map;
    map.size = {16, 16, 1};
    std::string bytes = map.str();
    MrcBytes claim = with({{1, 1000}, {2, 1000}, {3, 250}});
    if (scaled_down) claim = with({{1, 20}, {2, 20}, {3, 20}});
    return claim.header() + bytes.substr(1024);
}

std::vector<Defect> defects() {
    using namespace std::string_literals;
    const std::int32_t most = 2147483647, least = -most - 1;
    std::vector<Defect> all{
        {"ZeroColumns", with({{1, 0}}).str(), "columns (word 1) is 0"},
        {"NegativeRows", with({{2, -3}}).str(), "rows (word 2) is -3"},
        {"LeastSections", with({{3, least}}).str(), "sections (word 3) is -2147483648"},
        {"MostOfAll", with({{1, most}, {2, most}, {3, most}}).str(),
         "is cut off: expected 18446744073709551615 bytes"},
        // 4 · 2^21 · 2^21 · 2^20 = 2^64: 0 where the product wraps around.
        {"ProductOfZeroModulo2To64", with({{1, 1 << 21}, {2, 1 << 21}, {3, 1 << 20}}).str(), "is cut off"},
        // (2^21 · 2^21 · 2^20 + …) · 4 that wraps to little.
        {"ProductOfLittleModulo2To64", with({{1, 1 << 30}, {2, 1 << 30}, {3, 5}}).str(), "is cut off"},
        {"ColumnsTimesRowsWrapAt32Bits", with({{1, 65536}, {2, 65536}, {3, 1}}).str(),
         "is cut off: expected 17179870208 bytes"},
        {"NegativeExtendedHeader", with({{24, -80}}).str(), "NSYMBT (word 24) is -80"},
        {"LeastExtendedHeader", with({{24, least}}).str(), "NSYMBT (word 24) is -2147483648"},
        {"HugeExtendedHeader", with({{24, most}}).str(), "NSYMBT (word 24) is 2147483647"},
        {"ExtendedHeaderPastTheEnd", with({{24, 2000}}).str() + "more",
         "NSYMBT (word 24) is 2000, expected at most 100"},
        {"ExtendedHeaderThatTakesFromTheData", with({{24, 80}}).str() + "+", "is cut off"},
        {"CellNotANumber", with_float(11, NAN), "cell length (word 11) is nan"},
        {"CellInfinite", with_float(12, INFINITY), "cell length (word 12) is inf"},
        {"CellNegative", with_float(13, -4), "cell length (word 13) is negative"},
        {"AxesTwiceTheSame", with({{18, 1}}).str(), "are 1, 1, 3, expected 1, 2, 3"},
        {"AxesOutOfRange", with({{17, 10}, {18, 11}, {19, 12}}).str(), "are 10, 11, 12"},
        {"Empty", "", "is empty"},
        {"Text", "this is text and no map\n", "is text"},
        {"OneByteOfAHeaderMissing", MrcBytes().str().substr(0, 1023), "shorter than the header"},
        {"HeaderOnly", MrcBytes().header(), "is cut off"},
        {"OneByteMissing", MrcBytes().str().substr(0, 1119), "is cut off: expected 1120 bytes"},
        {"TakenForAVdb", " BDV\0\0\0\0"s + std::string(3000, '\1'), ""},
        {"BillionBytesPlain", lie(), "is cut off: expected 1000001024 bytes"},
        {"BillionBytesGzip", gzip(lie()), "cut off"},
        {"BillionBytesBzip2", bzip2(lie()), "cut off"},
        {"BillionBytesZstd", zstd(lie()), ""},
        {"TooFewBytesGzip", gzip(lie(true)), "ends early"},
        {"TooFewBytesBzip2", bzip2(lie(true)), "ends early"},
        {"TooFewBytesZstd", zstd(lie(true)), "ends early"},
        {"GzipCutOff", gzip(MrcBytes().str()).substr(0, 60), "ends early"},
        {"PackedTwice", gzip(zstd(MrcBytes().str())), "compressed twice"},
    };
    for (const int mode : {-1, 3, 4, 5, 7, 32, 100, 102, most})
        all.push_back(
            {"Mode" + (mode < 0 ? "Minus1"s : std::to_string(mode)), with({{4, mode}}).str(), "(word 4)"});
    MrcBytes big = with({{1, 1000}, {2, 1000}, {3, 250}});
    big.big_endian = true;
    all.push_back({"BillionBytesBigEndian", big.str(), "is cut off"});
    return all;
}

class DamagedHeader : public Cli, public testing::WithParamInterface<Defect> {};
class Damaged : public Cli {};

}  // namespace

INSTANTIATE_TEST_SUITE_P(Headers, DamagedHeader, testing::ValuesIn(defects()),
                         [](const auto& defect) { return defect.param.name; });

TEST_P(DamagedHeader, IsRefusedByEveryCommand) {
    const std::string map = make("a.mrc", GetParam().bytes), old = make("old.vdb", "as it was");
    const auto before = listing();
    for (Words words : std::vector<Words>{{"info", map, "--json"},
                                          {"info", map, "--validate"},
                                          {"convert", map, at("a.vdb")},
                                          {"convert", map, old},
                                          {"surface", map, at("a.ply")},
                                          {"model", map, "-o", at("m")}}) {
        SCOPED_TRACE(joined(words));
        words.insert(words.end(), {"--threads", "2"});
        const Ended r = vdbgeo(words, small_memory());
        expect_error(r, 3, map + ": ", GetParam().text);
        expect_small(r);
    }
    EXPECT_EQ(listing(), before);
    EXPECT_EQ(bytes("old.vdb"), "as it was");
}

TEST_F(Damaged, LyingSizesOnAPipe) {
    RunOptions options = small_memory();
    make("a.mrc", lie());
    options.input = at("a.mrc");
    expect_error(vdbgeo({"convert", "-", at("a.vdb")}, options), 3, "standard input: ", "cut off");
    EXPECT_FALSE(listing().count("a.vdb"));
}

TEST_F(Damaged, VdbFilesOfOtherContent) {
    const std::string grid = make("a.vdb", "this is text and no grid\n");
    expect_error(vdbgeo({"info", grid}), 3, grid + ": ");
    expect_error(vdbgeo({"convert", grid, at("b.mrc")}), 3, grid + ": ");
    phantom("c.vdb", 16);
    const std::string whole = bytes("c.vdb");
    for (const std::size_t length : {std::size_t(20), whole.size() / 2, whole.size() - 1}) {
        SCOPED_TRACE(length);
        const std::string cut = make("cut.vdb", whole.substr(0, length));
        const Ended r = vdbgeo({"info", cut}, small_memory());
        expect_error(r, 3, cut + ": ");
        expect_small(r);
    }
    EXPECT_FALSE(listing().count("b.mrc"));
}

TEST_F(Damaged, Meshes) {
    const std::vector<std::pair<std::string, std::string>> meshes{
        {"a.ply",
         "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\nproperty float x\nproperty "
         "float y\nproperty float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"},
        {"b.off", "OFF\n1000000000 1 0\n0 0 0\n"},
        {"c.stl", std::string(80, ' ') + "\xff\xff\xff\x7f"},
        {"d.obj", "v 0 0 0\nf 1 2 3\n"},
        {"e.ply", ""},
    };
    for (const auto& [name, content] : meshes) {
        const std::string mesh = make(name, content);
        for (const Words& words : std::vector<Words>{{"info", mesh},
                                                     {"measure", mesh},
                                                     {"convert", mesh, at("x.obj")},
                                                     {"render", mesh, at("x.png")}}) {
            SCOPED_TRACE(joined(words));
            const Ended r = vdbgeo(words, small_memory());
            expect_error(r, 3, mesh + ": ");
            expect_small(r);
        }
    }
    EXPECT_EQ(listing().size(), meshes.size());
}
