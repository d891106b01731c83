// Bytes held in memory, on the disk, or across both.
#include <gtest/gtest.h>

#include <random>

#include "converters/byte_store.h"
#include "converters/strip_source.h"
#include "tests/support/maps.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::TempFolder;

TEST(ByteStore, GivesBackWhatWasPutDownWhereverItLies) {
    TempFolder folder;
    for (const std::uint64_t memory :
         {std::uint64_t(0), std::uint64_t(1) << 20, std::uint64_t(3) << 20, std::uint64_t(1) << 30}) {
        ByteStore store(memory, folder.path());
        std::mt19937 random(5);
        std::string all;
        while (all.size() < 5'000'000) {
            std::string piece(random() % 70'000, ' ');
            for (char& c : piece) c = static_cast<char>(random());
            store.append(piece.data(), piece.size());
            all += piece;
            ASSERT_EQ(store.size(), all.size());
        }
        EXPECT_EQ(store.spilled(), memory >= all.size() ? 0 : all.size() - memory);
        for (int i = 0; i < 300; ++i) {
            const std::size_t at = random() % all.size(),
                              n = std::min<std::size_t>(random() % 2'000'000, all.size() - at);
            std::string got(n, '\0');
            store.read(at, got.data(), n);
            ASSERT_TRUE(got == all.substr(at, n)) << at << " " << n << " of " << memory;
        }
        EXPECT_TRUE(std::filesystem::is_empty(folder.path()));  // the file has no name
    }
}

TEST(ScratchFile, AFolderThatIsNotThereAndBytesThatAreNot) {
    TempFolder folder;
    EXPECT_THROW(ScratchFile(folder / "none"), IoError);
    ScratchFile file(folder.path());
    file.append("abc", 3);
    char out[4];
    EXPECT_THROW(file.read(0, out, 4), IoError);
}

TEST(StripSource, AnyHeightAndGroupHandsOutEverySampleOnce) {
    TempFolder folder;
    test::MrcBytes bytes;
    bytes.size = {23, 70, 19};
    bytes.axes = {2, 3, 1};
    for (const float v : test::noise(23 * 70 * 19, 3)) bytes.values.push_back(v);
    test::write_bytes(folder / "a.mrc", bytes.str());
    for (const int height : {1, 3, 8})
        for (const int group : {0, 2}) {
            StripSource source(folder / "a.mrc", {}, 1);
            std::vector<float> all(bytes.values.size(), -9);
            std::size_t strips = 0, ended = 0;
            source.pass(
                [&](const Strip& strip, int slab, int row, std::size_t place) {
                    EXPECT_EQ(static_cast<std::size_t>(row) % static_cast<std::size_t>(group ? group : 9),
                              place);
                    for (int s = 0; s < strip.sections; ++s)
                        for (int r = 0; r < strip.rows; ++r)
                            strip.copy_row(s, r, all.data() + ((slab * height + s) * 70 + row * 8 + r) * 23);
                },
                [&](std::size_t n) { strips += n; }, [&] { ++ended; }, {}, height, group);
            const std::size_t slabs = static_cast<std::size_t>((19 - 1) / height + 1);
            EXPECT_EQ(strips, 9 * slabs);
            EXPECT_EQ(ended, slabs * (group ? 5 : 1));
            for (std::size_t i = 0; i < all.size(); ++i)
                ASSERT_EQ(all[i], static_cast<float>(bytes.values[i]));
        }
}
