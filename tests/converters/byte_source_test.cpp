#include "converters/byte_source.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <thread>

#include "tests/support/pack.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::TempFolder;
using test::write_bytes;

namespace {

std::string noise(std::size_t count) {
    std::string bytes(count, '\0');
    std::uint32_t state = 1;
    for (char& c : bytes) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
    return bytes;
}

std::string read_all(ByteSource& source, std::size_t piece) {
    std::string all, part(piece, '\0');
    while (const std::size_t n = source.read(part.data(), piece)) all.append(part, 0, n);
    return all;
}

using Pack = std::string (*)(const std::string&);
struct Kind {
    const char* name;
    Pack pack;
};

class PackedSource : public testing::TestWithParam<Kind> {};

}  // namespace

INSTANTIATE_TEST_SUITE_P(Kinds, PackedSource,
                         testing::Values(Kind{"gzip", test::gzip}, Kind{"bzip2", test::bzip2},
                                         Kind{"zstd", test::zstd}),
                         [](const auto& kind) { return std::string(kind.param.name); });

TEST_P(PackedSource, GivesBackWhatWasPacked) {
    TempFolder folder;
    for (const std::string& bytes : {noise(300000), std::string(5000000, 'x'), std::string("a")}) {
        write_bytes(folder / "a.mrc", GetParam().pack(bytes));
        for (const std::size_t piece : {std::size_t(1000), std::size_t(777777)}) {
            const auto source = ByteSource::open(folder / "a.mrc");
            EXPECT_EQ(source->compression(), GetParam().name);
            EXPECT_FALSE(source->length());
            EXPECT_GE(source->length_bound(), bytes.size());
            EXPECT_TRUE(read_all(*source, piece) == bytes);
            EXPECT_EQ(source->position(), bytes.size());
            EXPECT_FALSE(source->cut_off());
        }
    }
}

TEST_P(PackedSource, PiecesPackedOneAfterAnotherAreOneStream) {
    TempFolder folder;
    const std::string first = noise(100000), second(3000, 'y');
    write_bytes(folder / "a", GetParam().pack(first) + GetParam().pack(second));
    EXPECT_TRUE(read_all(*ByteSource::open(folder / "a"), 50000) == first + second);
}

TEST_P(PackedSource, SkippingIsReading) {
    TempFolder folder;
    const std::string bytes = noise(200000);
    write_bytes(folder / "a", GetParam().pack(bytes));
    const auto source = ByteSource::open(folder / "a");
    EXPECT_EQ(source->skip(150000), 150000u);
    EXPECT_TRUE(read_all(*source, 1000) == bytes.substr(150000));
    EXPECT_EQ(source->skip(10), 0u);
}

TEST_P(PackedSource, CutOffDataIsNoticed) {
    TempFolder folder;
    const std::string bytes = noise(100000), packed = GetParam().pack(bytes);
    for (const std::size_t length : {packed.size() - 1, packed.size() / 2, std::size_t(12)}) {
        write_bytes(folder / "a", packed.substr(0, length));
        const auto source = ByteSource::open(folder / "a");
        const std::string found = read_all(*source, 10000);
        EXPECT_TRUE(source->cut_off()) << length;
        EXPECT_EQ(found, bytes.substr(0, found.size()));
    }
}

TEST_P(PackedSource, DamagedDataIsInvalidInput) {
    TempFolder folder;
    std::string packed = GetParam().pack(noise(100000));
    for (std::size_t i = packed.size() / 2; i < packed.size() / 2 + 64; ++i)
        packed[i] = static_cast<char>(~packed[i]);
    write_bytes(folder / "a", packed);
    const auto source = ByteSource::open(folder / "a");
    try {
        read_all(*source, 1000);
        // zstd without a checksum may not notice that raw blocks were changed.
        EXPECT_STREQ(GetParam().name, "zstd");
    } catch (const InvalidInput& error) {
        EXPECT_NE(std::string(error.what()).find("data is damaged near byte"), std::string::npos)
            << error.what();
    }
}

TEST(ByteSource, PlainFilesAreReadSkippedAndMeasured) {
    TempFolder folder;
    const std::string bytes = noise(100000);
    write_bytes(folder / "a.gz", bytes);  // the name says nothing
    const auto source = ByteSource::open(folder / "a.gz");
    EXPECT_EQ(source->compression(), "");
    EXPECT_EQ(source->length(), 100000u);
    EXPECT_EQ(source->skip(5), 5u);
    EXPECT_EQ(source->skip(50000), 50000u);
    EXPECT_TRUE(read_all(*source, 999) == bytes.substr(50005));
    EXPECT_EQ(source->skip(1), 0u);
}

TEST(ByteSource, SmallerThanAnyMagic) {
    TempFolder folder;
    write_bytes(folder / "a", "ab");
    EXPECT_EQ(read_all(*ByteSource::open(folder / "a"), 10), "ab");
    write_bytes(folder / "b", "");
    EXPECT_EQ(read_all(*ByteSource::open(folder / "b"), 10), "");
}

TEST(ByteSource, MissingFilesAndFoldersAreIoErrors) {
    TempFolder folder;
    EXPECT_THROW(ByteSource::open(folder / "none"), IoError);
    EXPECT_THROW(ByteSource::open(folder.path()), IoError);
}

TEST(ByteSource, PipesAreReadWithoutKnowingTheirLength) {
    TempFolder folder;
    const std::string bytes = noise(300000), pipe = (folder / "pipe").string();
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    for (const std::string& sent : {bytes, test::gzip(bytes)}) {
        std::thread writer([&] { write_bytes(pipe, sent); });
        const auto source = ByteSource::open(pipe);
        EXPECT_FALSE(source->length());
        EXPECT_EQ(source->skip(100001), 100001u);
        EXPECT_TRUE(read_all(*source, 70000) == bytes.substr(100001));
        writer.join();
    }
}
