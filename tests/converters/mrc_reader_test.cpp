#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

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

std::vector<double> read_all(MrcReader& reader, int piece = 1) {
    const Vec3i& size = reader.frame().size;
    const std::size_t section = static_cast<std::size_t>(size[reader.order()[0]] * size[reader.order()[1]]);
    std::vector<double> all;
    while (reader.sections_left() > 0) {
        const int count = std::min(piece, reader.sections_left());
        std::vector<float> values(section * static_cast<std::size_t>(count));
        reader.read_sections(values.data(), count);
        all.insert(all.end(), values.begin(), values.end());
    }
    return all;
}

bool warns(const MrcReader& reader, const std::string& about) {
    const auto& w = reader.warnings();
    return std::any_of(w.begin(), w.end(),
                       [&](const auto& line) { return line.find(about) != std::string::npos; });
}

void expect_near(const Vec3d& found, const Vec3d& expected, double tolerance = 1e-5) {
    EXPECT_LT((found - expected).norm(), tolerance)
        << "found " << found.transpose() << ", expected " << expected.transpose();
}

class MrcRead : public testing::Test {
 protected:
    MrcReader open(const MrcBytes& map, const MrcReadOptions& options = {}) {
        write_bytes(folder_ / "a.mrc", map.str());
        return MrcReader(folder_ / "a.mrc", options);
    }
    TempFolder folder_;
};

}  // namespace

TEST_F(MrcRead, EveryModeInBothByteOrders) {
    struct Case {
        int mode;
        std::vector<double> values;
    };
    for (const Case& c : {Case{0, {-128, 127, -1, 0, 5, 6}}, Case{1, {-32768, 32767, -1, 0, 258, 6}},
                          Case{2, {-1.5, 3e30, 1e-30, 0, 5, 6}}, Case{6, {0, 65535, 1, 258, 5, 32768}},
                          Case{12, {-1.5, 65504, 0.0625, 0, 5, 1024}}, Case{101, {0, 15, 1, 7, 8, 9}}}) {
        for (const bool big : {false, true}) {
            MrcBytes map;
            map.mode = c.mode;
            map.big_endian = big;
            map.size = {3, 1, 2};
            map.values = c.values;
            for (double& v : map.values)
                if (c.mode == 2) v = static_cast<float>(v);
            MrcReader reader = open(map);
            EXPECT_EQ(reader.header().swapped, big);
            EXPECT_EQ(read_all(reader), map.values) << "mode " << c.mode << " big-endian " << big;
            EXPECT_TRUE(reader.warnings().empty()) << reader.warnings().front();
        }
    }
}

TEST_F(MrcRead, FourBitRowsAreWholeBytes) {
    for (const int columns : {1, 2, 5, 8}) {
        MrcBytes map;
        map.mode = 101;
        map.size = {columns, 3, 2};
        ASSERT_EQ(map.data().size(), static_cast<std::size_t>((columns + 1) / 2 * 6));
        MrcReader reader = open(map);
        EXPECT_EQ(read_all(reader, 2), map.all_values());
    }
}

TEST_F(MrcRead, MoreSamplesThanOneBuffer) {
    for (const int mode : {0, 1, 2, 12, 101}) {
        MrcBytes map;
        map.mode = mode;
        map.size = {1501, 701, 3};
        MrcReader reader = open(map);
        EXPECT_TRUE(read_all(reader, 2) == map.all_values()) << mode;
    }
}

TEST_F(MrcRead, BytesAreSignedUnlessImodOrTheCallerSayUnsigned) {
    using Mode0 = MrcReadOptions::Mode0;
    MrcBytes map;
    map.mode = 0;
    map.size = {2, 1, 1};
    map.values = {200, 1};
    const auto first = [&](Mode0 mode0) {
        MrcReadOptions options;
        options.mode0 = mode0;
        MrcReader reader = open(map, options);
        return read_all(reader)[0];
    };
    EXPECT_EQ(first(Mode0::automatic), -56);
    EXPECT_EQ(first(Mode0::as_unsigned), 200);
    map.set(40, 0);
    EXPECT_EQ(first(Mode0::automatic), -56);
    map.set(39, 1146047817);
    EXPECT_EQ(first(Mode0::automatic), 200);
    EXPECT_EQ(first(Mode0::as_signed), -56);
    map.set(40, 12 + 1);
    EXPECT_EQ(first(Mode0::automatic), -56);
    map.set(39, 16843009);
    map.set(40, 16843008);
    EXPECT_EQ(first(Mode0::automatic), -56) << "junk is no stamp";
    map.text[53] = std::string(4, '\0');
    EXPECT_EQ(first(Mode0::automatic), -56) << "an old file without MAP is signed all the same";
}

TEST_F(MrcRead, ByteOrderComesFromTheNumbersAndThenFromTheStamp) {
    for (const bool big : {false, true}) {
        MrcBytes map;
        map.big_endian = big;
        for (const char* stamp : {"\x44\x44", "\x11\x11", "\0\0", "MA"}) {
            map.text[54] = std::string(stamp, 2);
            MrcReader reader = open(map);
            EXPECT_EQ(reader.header().swapped, big);
            EXPECT_EQ(read_all(reader), map.all_values());
        }
    }
    // 65536 x 256 x 1 is 256 x 65536 x 16777216 the other way round; mode 0 and the axes decide.
    MrcBytes map;
    map.mode = 0;
    map.size = {65536, 256, 1};
    EXPECT_FALSE(open(map).header().swapped);
}

TEST_F(MrcRead, EveryOrderOfTheAxes) {
    std::array<int, 3> axes{1, 2, 3};
    do {
        MrcBytes map;
        map.axes = {axes[0], axes[1], axes[2]};
        map.start = {7, -8, 9};
        map.voxel = {1, 2, 3};
        MrcReader reader = open(map);
        Vec3i size;
        Vec3d origin;
        for (int i = 0; i < 3; ++i) {
            const auto k = static_cast<std::size_t>(i);
            const int axis = axes[k] - 1;
            EXPECT_EQ(reader.order()[k], axis);
            size[axis] = map.size[k];
            origin[axis] = map.start[k] * (axis + 1.0);
        }
        EXPECT_EQ(reader.frame().size, size);
        expect_near(reader.frame().voxel_size(), Vec3d(1, 2, 3));
        expect_near(reader.frame().origin, origin);
        EXPECT_EQ(reader.origin_rule(), "nstart");
        EXPECT_EQ(read_all(reader), map.all_values());
    } while (std::next_permutation(axes.begin(), axes.end()));
}

TEST_F(MrcRead, OriginIsTakenInThisOrder) {
    MrcBytes map;
    map.size = {10, 10, 10};
    EXPECT_EQ(open(map).origin_rule(), "zero");
    map.start = {3, 4, 5};
    map.voxel = {2, 2, 2};
    EXPECT_EQ(open(map).origin_rule(), "nstart");
    expect_near(open(map).frame().origin, Vec3d(6, 8, 10));
    map.origin = {0, -1.5f, 0};
    EXPECT_EQ(open(map).origin_rule(), "header");
    expect_near(open(map).frame().origin, Vec3d(0, -1.5, 0));
    map.origin = {0, 200, 0};
    EXPECT_EQ(open(map).origin_rule(), "header") << "ten boxes are near enough";
    for (const float bad : {201.f, -1e30f, INFINITY, NAN}) {
        map.origin = {0, bad, 0};
        MrcReader reader = open(map);
        EXPECT_EQ(reader.origin_rule(), "nstart");
        EXPECT_TRUE(warns(reader, "ORIGIN (words 50-52)"));
    }
    map.start = {3, 101, 5};
    EXPECT_EQ(open(map).origin_rule(), "zero");
    EXPECT_TRUE(warns(open(map), "NSTART (word 6) is 101 for 10 samples"));
    map.sampling = {200, 200, 200};
    EXPECT_EQ(open(map).origin_rule(), "nstart") << "honest in a crystal cell of 200 steps";
}

TEST_F(MrcRead, OriginOfTheCallersChoice) {
    MrcBytes map;
    map.start = {3, 4, 5};
    map.origin = {1, 2, 1e6f};
    const auto origin = [&](OriginRule rule) {
        MrcReadOptions options;
        options.origin = rule;
        options.origin_A = Vec3d(7, 8, 9);
        return open(map, options).frame().origin;
    };
    expect_near(origin(OriginRule::automatic), Vec3d(3, 4, 5));
    expect_near(origin(OriginRule::header), Vec3d(1, 2, 1e6));
    expect_near(origin(OriginRule::nstart), Vec3d(3, 4, 5));
    expect_near(origin(OriginRule::zero), Vec3d(0, 0, 0));
    expect_near(origin(OriginRule::given), Vec3d(7, 8, 9));
    map.origin[2] = NAN;
    EXPECT_THROW(origin(OriginRule::header), InvalidInput);
}

TEST_F(MrcRead, SkewIsUndone) {
    MrcBytes map;
    map.size = {10, 10, 10};
    map.start = {1, 0, 0};
    map.set(25, 1);
    const std::array<float, 12> skew{0, 1, 0, -1, 0, 0, 0, 0, 1, 10, 20, 30};  // S turns y into x; then t
    for (int i = 0; i < 12; ++i) map.set(26 + i, skew[static_cast<std::size_t>(i)]);
    map.exttyp = std::string("\0\0\x80\x3f", 4);  // S12 = 1 shares its word with EXTTYP
    const MrcReader reader = open(map);
    EXPECT_EQ(reader.origin_rule(), "nstart+skwtrn");
    // map = S (world - t): the sample (1, 0, 0) of the map frame lies at S^-1 (1, 0, 0) + t.
    expect_near(reader.frame().origin, Vec3d(10, 21, 30));
    expect_near(reader.frame().to_world(Vec3d(1, 0, 0)), Vec3d(10, 22, 30));
    map.start = {0, 0, 0};
    EXPECT_EQ(open(map).origin_rule(), "skwtrn");
    map.set(28, 20140);
    EXPECT_EQ(open(map).origin_rule(), "zero") << "MRC2014 has no skew";
    map.set(28, 0.f);
    map.origin = {1, 1, 1};
    EXPECT_EQ(open(map).origin_rule(), "header");
    EXPECT_TRUE(warns(open(map), "LSKFLG"));
    map.origin = {0, 0, 0};
    map.set(26, 5.f);
    EXPECT_TRUE(warns(open(map), "no rotation"));
}

TEST_F(MrcRead, SkewedCells) {
    MrcBytes map;
    map.voxel = {2, 3, 4};
    map.angles = {80, 94.326f, 120};
    map.start = {1, 1, 1};
    const Frame frame = open(map).frame();
    const auto angle = [&](int a, int b) {
        return std::acos(frame.axes.col(a).normalized().dot(frame.axes.col(b).normalized())) * 180 / M_PI;
    };
    expect_near(Vec3d(angle(1, 2), angle(0, 2), angle(0, 1)), Vec3d(80, 94.326, 120));
    expect_near(frame.voxel_size(), Vec3d(2, 3, 4));
    EXPECT_EQ(frame.axes(1, 0), 0);  // a along x, b in the xy plane
    EXPECT_EQ(frame.axes(2, 0), 0);
    EXPECT_EQ(frame.axes(2, 1), 0);
    EXPECT_GT(frame.axes.determinant(), 0);
    expect_near(frame.origin, frame.axes * Vec3d(1, 1, 1));
}

TEST_F(MrcRead, AnglesThatMakeNoCellReadAs90) {
    for (const std::array<float, 3>& angles : {std::array<float, 3>{0, 0, 0},
                                               {90, 90, 180},
                                               {-90, 90, 90},
                                               {NAN, 90, 90},
                                               {10, 90, 170},
                                               {90, 1e30f, 90}}) {
        MrcBytes map;
        map.angles = angles;
        const MrcReader reader = open(map);
        EXPECT_TRUE(warns(reader, "words 14-16"));
        EXPECT_EQ(reader.frame().axes, Mat3d::Identity());
    }
}

TEST_F(MrcRead, VoxelSizeIsTheCellOverMUnlessOnlyTheSamplesMakeSense) {
    MrcBytes map;
    map.size = {10, 20, 30};
    map.sampling = {100, 50, 25};
    map.voxel = {1.5f, 2, 2.5f};
    expect_near(open(map).frame().voxel_size(), Vec3d(1.5, 2, 2.5));
    EXPECT_TRUE(open(map).warnings().empty());

    map.sampling = {10, 20, 1};  // the cell is the whole depth
    map.voxel = {1.5f, 1.5f, 45};
    expect_near(open(map).frame().voxel_size(), Vec3d(1.5, 1.5, 1.5));
    EXPECT_TRUE(warns(open(map), "MZ (word 10) is 1 for 30 samples along Z"));
    EXPECT_EQ(open(map).sampling(), Vec3i(10, 20, 30));

    map.sampling = {10, 20, 0};
    map.set(13, 45.f);
    expect_near(open(map).frame().voxel_size(), Vec3d(1.5, 1.5, 1.5));
    map.sampling = {-1, 20, 30};
    map.set(11, 15.f);
    expect_near(open(map).frame().voxel_size(), Vec3d(1.5, 1.5, 1.5));
    EXPECT_TRUE(warns(open(map), "MX (word 8) is -1"));

    map.words.clear();
    map.sampling = {10, 20, 30};
    map.voxel = {4, 4, 100};  // honest serial sections
    expect_near(open(map).frame().voxel_size(), Vec3d(4, 4, 100));
    EXPECT_TRUE(open(map).warnings().empty());

    map.sampling = {20, 10, 30};
    map.voxel = {4, 4, 4};
    expect_near(open(map).frame().voxel_size(), Vec3d(4, 4, 4));
    EXPECT_TRUE(warns(open(map), "MX and MY (words 8, 9) are 20 and 10, swapped"));
}

TEST_F(MrcRead, CellsThatAreUnset) {
    MrcBytes map;
    map.set(11, 0.f), map.set(12, 0.f), map.set(13, 0.f);
    const MrcReader reader = open(map);
    EXPECT_EQ(reader.frame().axes, Mat3d::Identity());
    EXPECT_TRUE(warns(reader, "(word 11) gives no voxel size"));
    for (const float bad : {-4.f, NAN, INFINITY}) {
        map.set(12, bad);
        try {
            open(map);
            ADD_FAILURE() << bad;
        } catch (const InvalidInput& error) {
            EXPECT_NE(std::string(error.what()).find("(word 12)"), std::string::npos) << error.what();
        }
        MrcReadOptions options;
        options.voxel_size_A = Vec3d(1, 2, 3);
        expect_near(open(map, options).frame().voxel_size(), Vec3d(1, 2, 3));
    }
}

TEST_F(MrcRead, OptionsAreChecked) {
    MrcReadOptions options;
    options.voxel_size_A = Vec3d(1, 0, 1);
    EXPECT_THROW(options.check(), InvalidInput);
    options = {};
    options.origin_A[1] = NAN;
    EXPECT_THROW(options.check(), InvalidInput);
    options = {};
    options.volume = -1;
    EXPECT_THROW(options.check(), InvalidInput);
}

TEST_F(MrcRead, ExtendedHeadersAreSkipped) {
    for (const std::size_t length : {80, 122, 5000}) {
        MrcBytes map;
        map.extended = std::string(length, 'X');
        MrcReader reader = open(map);
        EXPECT_EQ(read_all(reader), map.all_values());
        EXPECT_TRUE(reader.warnings().empty());
    }
}

TEST_F(MrcRead, AnExtendedHeaderThatIsPromisedButAbsent) {
    MrcBytes map;
    map.set(24, 160);
    MrcReader plain = open(map);
    EXPECT_EQ(read_all(plain), map.all_values());
    EXPECT_TRUE(warns(plain, "NSYMBT (word 24) promises an extended header of 160 bytes that is not there"));
    write_bytes(folder_ / "b", test::gzip(map.str()));
    MrcReader packed(folder_ / "b");
    EXPECT_EQ(read_all(packed), map.all_values());
    EXPECT_TRUE(warns(packed, "that is not there"));
    write_bytes(folder_ / "c", map.str() + "+");  // fits neither way
    EXPECT_THROW(MrcReader(folder_ / "c"), InvalidInput);
}

TEST_F(MrcRead, BytesAfterTheDataAreToldOf) {
    const MrcBytes map;
    write_bytes(folder_ / "a", map.str() + "more");
    MrcReader plain(folder_ / "a");
    EXPECT_TRUE(warns(plain, "4 bytes follow the data: expected 1120 bytes (words 1-4 and 24), found 1124"));
    write_bytes(folder_ / "b", test::zstd(map.str() + "more"));
    MrcReader packed(folder_ / "b");
    EXPECT_TRUE(packed.warnings().empty());
    EXPECT_EQ(read_all(packed), map.all_values());
    EXPECT_TRUE(warns(packed, "more bytes follow the data"));
}

TEST_F(MrcRead, CompressedFilesAreKnownByContent) {
    MrcBytes map;
    map.size = {30, 40, 50};
    map.mode = 1;
    map.extended = std::string(80, ' ');
    for (const auto pack : {test::gzip, test::bzip2, test::zstd}) {
        write_bytes(folder_ / "a.mrc", pack(map.str()));
        MrcReader reader(folder_ / "a.mrc");
        EXPECT_TRUE(read_all(reader, 8) == map.all_values());
        EXPECT_TRUE(reader.warnings().empty());
    }
}

TEST_F(MrcRead, StacksOfVolumes) {
    MrcBytes map;
    map.size = {4, 3, 6};
    map.ispg = 401;
    map.sampling = {4, 3, 2};
    const std::vector<double> all = map.all_values();
    for (int k = 0; k < 3; ++k)
        for (const bool packed : {false, true}) {
            write_bytes(folder_ / "a", packed ? test::gzip(map.str()) : map.str());
            MrcReadOptions options;
            options.volume = k;
            MrcReader reader(folder_ / "a", options);
            EXPECT_EQ(reader.volumes(), 3);
            EXPECT_EQ(reader.sections_left(), 2);
            EXPECT_EQ(reader.frame().size, Vec3i(4, 3, 2));
            EXPECT_EQ(read_all(reader),
                      std::vector<double>(all.begin() + 24 * k, all.begin() + 24 * (k + 1)));
            EXPECT_TRUE(warns(reader, "a stack of 3 volumes"));
        }
    MrcReadOptions options;
    options.volume = 3;
    EXPECT_THROW(open(map, options), InvalidInput);
    map.sampling = {4, 3, 4};
    EXPECT_EQ(open(map).frame().size, Vec3i(4, 3, 6));
    EXPECT_TRUE(warns(open(map), "does not divide"));
}

TEST_F(MrcRead, StacksOfImagesAreReadAsSections) {
    MrcBytes map;
    map.size = {4, 3, 6};
    map.ispg = 0;
    map.sampling = {4, 3, 1};
    MrcReader reader = open(map);
    EXPECT_TRUE(warns(reader, "a stack of 6 images"));
    EXPECT_EQ(read_all(reader), map.all_values());
    map.sampling = {4, 3, 6};
    EXPECT_TRUE(open(map).warnings().empty()) << "ISPG 0 with MZ = NZ is a volume";
}

TEST_F(MrcRead, ScaledBytes) {
    MrcBytes map;
    map.mode = 0;
    map.size = {3, 1, 1};
    map.values = {-128, 127, 0};
    map.set(40, -128);
    map.set(41, 127);
    map.set(20, -2.f);
    map.set(21, 3.1f);
    MrcReader reader = open(map);
    EXPECT_EQ(reader.value_type(), "int8 scaled");
    EXPECT_TRUE(warns(reader, "words 40 and 41"));
    const std::vector<double> values = read_all(reader);
    EXPECT_NEAR(values[0], -2, 1e-5);
    EXPECT_NEAR(values[1], 3.1, 1e-5);
    EXPECT_NEAR(values[2], -2 + 128 * 5.1 / 255, 1e-5);
    map.set(21, -3.f);
    EXPECT_EQ(open(map).value_type(), "int8");
    map.set(21, 3.f);
    map.set(41, 0);
    EXPECT_EQ(open(map).value_type(), "int8");
}

TEST_F(MrcRead, ValuesThatAreNoNumbersAreData) {
    MrcBytes map;
    map.size = {3, 1, 1};
    map.values = {NAN, INFINITY, 1};
    MrcReader reader = open(map);
    const std::vector<double> values = read_all(reader);
    EXPECT_TRUE(std::isnan(values[0]));
    EXPECT_EQ(values[1], INFINITY);
}

TEST_F(MrcRead, NoMoreSectionsThanThereAre) {
    MrcReader reader = open(MrcBytes());
    std::vector<float> out(100);
    EXPECT_THROW(reader.read_sections(out.data(), 3), InvalidInput);
    EXPECT_THROW(reader.read_sections(out.data(), -1), InvalidInput);
    reader.read_sections(out.data(), 2);
    EXPECT_EQ(reader.sections_left(), 0);
    EXPECT_THROW(reader.read_sections(out.data(), 1), InvalidInput);
}

TEST_F(MrcRead, LabelsAreTrimmedText) {
    MrcBytes map;
    map.set(56, 3);
    map.text[57] = "first   ";
    map.text[77] = std::string(
        "se\x01"
        "cond\0junk",
        12);
    EXPECT_EQ(open(map).header().labels, (std::vector<std::string>{"first", "se?cond"}));
}
