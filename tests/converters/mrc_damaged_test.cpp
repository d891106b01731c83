// Files that are no maps, lie, or end early: each is refused in one line that names the fault.
#include <gtest/gtest.h>

#include <random>

#include "converters/mrc.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/pack.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::MrcBytes;
using test::TempFolder;
using test::write_bytes;

namespace {

class MrcDamaged : public testing::Test {
 protected:
    /// The message with which these bytes are refused, on opening or on reading.
    std::string refusal(const std::string& bytes) {
        write_bytes(folder_ / "a.mrc", bytes);
        try {
            MrcReader reader(folder_ / "a.mrc");
            Array<float> out(static_cast<std::size_t>(reader.header().nx) *
                             static_cast<std::size_t>(reader.header().ny));
            while (reader.sections_left() > 0) reader.read_sections(out.data(), 1);
        } catch (const InvalidInput& error) {
            const std::string message = error.what(), name = (folder_ / "a.mrc").string();
            EXPECT_EQ(message.find(name + ": "), 0u) << message;
            EXPECT_EQ(message.find('\n'), std::string::npos);
            return message.substr(name.size() + 2);
        }
        return "not refused";
    }
    void expect_refusal(const std::string& bytes, const std::string& text) {
        const std::string message = refusal(bytes);
        EXPECT_NE(message.find(text), std::string::npos) << "found: " << message << "\nexpected: " << text;
    }
    TempFolder folder_;
};

std::string with_word(int word, std::int32_t value) {
    MrcBytes map;
    map.set(word, value);
    return map.str();
}

}  // namespace

TEST_F(MrcDamaged, ModesThatCannotBeRead) {
    expect_refusal(with_word(4, 3), "mode 3 (word 4) is a transform of complex numbers (16-bit integers)");
    expect_refusal(with_word(4, 4), "mode 4 (word 4) is a transform of complex numbers (32-bit floats)");
    for (const int mode : {-1, 5, 7, 16, 32, 100, 102, 2000000000})
        expect_refusal(with_word(4, mode),
                       "the mode (word 4) is " + std::to_string(mode) + ", expected 0, 1, 2, 6");
}

TEST_F(MrcDamaged, SizesThatCannotBe) {
    expect_refusal(with_word(1, 0), "the number of columns (word 1) is 0, expected at least 1");
    expect_refusal(with_word(2, -5), "the number of rows (word 2) is -5");
    expect_refusal(with_word(3, -2147483647 - 1), "the number of sections (word 3) is -2147483648");
}

TEST_F(MrcDamaged, AxesThatCannotBe) {
    for (const std::array<int, 3>& axes :
         {std::array<int, 3>{1, 1, 3}, {10, 11, 12}, {0, 0, 0}, {1, 2, 4}, {-1, 2, 3}}) {
        MrcBytes map;
        for (int i = 0; i < 3; ++i) map.set(17 + i, axes[static_cast<std::size_t>(i)]);
        expect_refusal(map.str(), "(words 17-19) are " + std::to_string(axes[0]) + ", " +
                                      std::to_string(axes[1]) + ", " + std::to_string(axes[2]) +
                                      ", expected 1, 2, 3 in some order");
    }
}

TEST_F(MrcDamaged, ExtendedHeadersThatCannotBe) {
    expect_refusal(with_word(24, -80), "NSYMBT (word 24) is -80, expected 0 or more");
    expect_refusal(with_word(24, 2000000000), "NSYMBT (word 24) is 2000000000, expected at most 96");
    expect_refusal(with_word(24, 81) + "+", "the file is cut off: expected 1201 bytes");
    write_bytes(folder_ / "b", test::gzip(with_word(24, 2000000000)));
    EXPECT_THROW(MrcReader(folder_ / "b"), InvalidInput);
}

TEST_F(MrcDamaged, FilesThatEndEarlyAreRefusedOnOpening) {
    const std::string whole = MrcBytes().str();
    for (const std::size_t length : {whole.size() - 1, std::size_t(1025), std::size_t(1024)}) {
        write_bytes(folder_ / "b", whole.substr(0, length));
        EXPECT_THROW(MrcReader(folder_ / "b"), InvalidInput) << length;
        expect_refusal(whole.substr(0, length),
                       "the file is cut off: expected 1120 bytes for 4 x 3 x 2 samples of mode "
                       "2 (words 1-4) behind 1024 bytes of header (NSYMBT, word 24), found " +
                           std::to_string(length));
    }
    expect_refusal(whole.substr(0, 1023),
                   "is shorter than the header: expected at least 1024 bytes, found 1023");
}

TEST_F(MrcDamaged, SizesThatOverflow64Bits) {
    MrcBytes map;
    for (int word = 1; word <= 3; ++word) map.set(word, 2147483647);
    expect_refusal(map.str(), "the file is cut off: expected 18446744073709551615 bytes");
    expect_refusal(test::bzip2(map.str()), "the file is cut off: expected 18446744073709551615 bytes");
}

TEST_F(MrcDamaged, CompressedFilesThatLieAboutTheirSize) {
    for (const auto pack : {test::gzip, test::bzip2, test::zstd}) {
        MrcBytes map;
        map.set(1, 1000), map.set(2, 1000), map.set(3, 1000);
        const std::string far = pack(map.str());
        expect_refusal(far, "but its compressed data can hold at most");
        map.set(1, 10), map.set(2, 10), map.set(3, 3);  // within what the compression could hold
        const std::string near = pack(map.str());
        const std::string message = refusal(near);
        EXPECT_NE(
            message.find(
                "data ends early: expected 2224 bytes for 10 x 10 x 3 samples of mode 2 (words 1-4) and "
                "their header, found 1120"),
            std::string::npos)
            << message;
        expect_refusal(near.substr(0, near.size() - 5), "data ends early");
    }
}

TEST_F(MrcDamaged, WholeDataInCutOffCompression) {
    const std::string packed = test::gzip(MrcBytes().str());
    expect_refusal(packed.substr(0, packed.size() - 1), "the gzip data ends early");
    std::string wrong = packed;
    wrong[packed.size() - 6] = static_cast<char>(~wrong[packed.size() - 6]);
    expect_refusal(wrong, "the gzip data is damaged");
}

TEST_F(MrcDamaged, FilesOfOtherKinds) {
    using namespace std::string_literals;
    expect_refusal("", "the file is empty");
    expect_refusal("../data/map.mrc", "is text, expected an MRC/CCP4 map");
    expect_refusal(std::string(5000, 'T'), "is text, expected an MRC/CCP4 map");
    expect_refusal(test::gzip("ATOM      1  N   MET A   1\n"), "is text inside gzip");
    expect_refusal(" BDV\0\0\0\0"s + std::string(3000, '\1'), "is an OpenVDB file");
    expect_refusal("\x89HDF\r\n\x1a\n"s + std::string(3000, '\0'), "is an HDF5 file");
    expect_refusal("II*\0\x08"s + std::string(3000, '\0'), "is a TIFF picture");
    expect_refusal(":-) Origin 1 2 3"s + std::string(3000, '\0'), "is a BRIX map");
    expect_refusal("\xfd"s + "7zXZ\0"s + std::string(40, '\1'), "is xz-compressed");
    expect_refusal(test::gzip(test::gzip(MrcBytes().str())), "compressed twice");
    std::string tar(2048, '\0');
    tar.replace(0, 7, "map.mrc").replace(257, 5, "ustar");
    expect_refusal(test::gzip(tar), "is a tar archive inside gzip");
    std::string em(512 + 4 * 512, '\0');
    em.replace(0, 16, "\6\0\0\5\x08\0\0\0\x08\0\0\0\x08\0\0\0"s);
    expect_refusal(em, "is an EM-format file");
    std::string dsn6(4096, '\0');
    dsn6.replace(0, 8, "\0\7\xff\xda\xff\xd6\0\x55"s).replace(36, 2, "\0\x64"s);
    expect_refusal(dsn6, "is a DSN6 map");
}

TEST_F(MrcDamaged, WhatCannotBeOpenedIsAnIoError) {
    EXPECT_THROW(MrcReader(folder_ / "none.mrc"), IoError);
    EXPECT_THROW(MrcReader{folder_.path()}, IoError);
    EXPECT_THROW(validate_mrc(folder_ / "none.mrc"), IoError);
}

TEST_F(MrcDamaged, RandomDamageIsReadOrRefused) {
    std::mt19937 random(1);
    const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
    int read = 0, refused = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        MrcBytes map;
        const std::array modes{0, 1, 2, 6, 12, 101};
        map.mode = modes[below(modes.size())];
        map.big_endian = trial % 2 == 0;
        map.size = {5, 4, 3};
        if (trial % 3 == 0) map.extended = std::string(160, ' ');
        if (trial % 7 == 0) map.ispg = 401;
        std::string bytes = map.str();
        for (std::size_t flips = below(8); flips-- > 0;) {
            // Half of the damage goes to the words that say where the data is.
            const std::size_t place = random() % 2 ? below(100) : below(bytes.size());
            bytes[place] = static_cast<char>(random());
        }
        if (trial % 4 == 0) bytes.resize(below(bytes.size()));
        if (trial % 11 == 0) bytes = test::gzip(bytes);
        if (trial % 13 == 0) bytes = test::zstd(bytes);
        write_bytes(folder_ / "a.mrc", bytes);
        try {
            MrcReader reader(folder_ / "a.mrc");
            const std::uint64_t section = static_cast<std::uint64_t>(reader.header().nx) *
                                          static_cast<std::uint64_t>(reader.header().ny);
            // Packed data of this size can hold no more than 33000 times as much; 4 bits are half a byte.
            const bool plain = trial % 11 != 0 && trial % 13 != 0;
            ASSERT_LE(section, 2 * bytes.size() * (plain ? 1 : 33000));
            EXPECT_TRUE(reader.frame().axes.allFinite());
            EXPECT_TRUE(reader.frame().origin.allFinite());
            Array<float> out(section);
            while (reader.sections_left() > 0) reader.read_sections(out.data(), 1);
            ++read;
        } catch (const InvalidInput&) {
            ++refused;
        }
    }
    EXPECT_GT(read, 200);
    EXPECT_GT(refused, 200);
}
