#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "converters/mrc.h"
#include "tests/support/data.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::data_folder;
using test::MrcBytes;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;

namespace {

/// A file as a map with every sample active.
DensityMap load(const std::filesystem::path& path, const MrcReadOptions& options = {}) {
    MrcReader reader(path, options);
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(-7);
    map.frame = reader.frame();
    const auto order = reader.order();
    const int columns = map.frame.size[order[0]], rows = map.frame.size[order[1]],
              sections = reader.sections_left();
    std::vector<float> values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    auto accessor = map.grid->getAccessor();
    for (int s = 0; s < sections; ++s) {
        reader.read_sections(values.data(), 1);
        const float* value = values.data();
        for (int r = 0; r < rows; ++r)
            for (int c = 0; c < columns; ++c) {
                openvdb::Coord at;
                at[order[0]] = c, at[order[1]] = r, at[order[2]] = s;
                accessor.setValue(at, *value++);
            }
    }
    store_mrc_metadata(*map.grid, reader, path.string());
    return map;
}

std::string data_bytes(const std::filesystem::path& path) {
    std::int32_t nsymbt = 0;
    const std::string bytes = read_bytes(path);
    std::memcpy(&nsymbt, bytes.data() + 92, 4);
    return bytes.substr(1024 + static_cast<std::size_t>(nsymbt));
}

void expect_same_frame(const Frame& a, const Frame& b) {
    EXPECT_EQ(a.size, b.size);
    EXPECT_LT((a.axes - b.axes).norm(), 1e-6 * a.axes.norm());
    EXPECT_LT((a.origin - b.origin).norm(), 1e-6 * (a.axes.norm() + a.origin.norm()));
}

void expect_flawless(const std::filesystem::path& path) {
    for (const std::string& line : validate_mrc(path)) ADD_FAILURE() << line;
}

DensityMap small_map(const std::vector<float>& values) {
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(0);
    map.frame.size = Vec3i(static_cast<int>(values.size()), 1, 1);
    auto accessor = map.grid->getAccessor();
    for (std::size_t i = 0; i < values.size(); ++i) accessor.setValue({static_cast<int>(i), 0, 0}, values[i]);
    return map;
}

class MrcWrite : public testing::Test {
 protected:
    std::filesystem::path in() const { return folder_ / "in.mrc"; }
    std::filesystem::path out() const { return folder_ / "out.mrc"; }
    TempFolder folder_;
};

}  // namespace

TEST_F(MrcWrite, EveryModeAndOrderOfAxesGivesBackTheSameBytes) {
    for (const int mode : {0, 1, 2, 6, 12, 101}) {
        std::array<int, 3> axes{1, 2, 3};
        do {
            MrcBytes bytes;
            bytes.mode = mode;
            bytes.size = {9, 10, 17};  // leaf borders are crossed along each axis
            bytes.axes = {axes[0], axes[1], axes[2]};
            bytes.start = {3, -4, 5};
            bytes.voxel = {1.5f, 2, 2.5f};
            bytes.angles = {80, 94.326f, 120};
            bytes.sampling = {40, 50, 60};
            bytes.ispg = 4;
            write_bytes(in(), bytes.str());
            const DensityMap map = load(in());
            write_mrc(map, out());
            EXPECT_TRUE(data_bytes(out()) == bytes.data()) << "mode " << mode;
            expect_flawless(out());
            const MrcReader before(in()), after(out());
            expect_same_frame(before.frame(), after.frame());
            EXPECT_EQ(after.header().mode, mode);
            EXPECT_EQ(after.order(), before.order());
            EXPECT_EQ(after.origin_rule(), "nstart");
            EXPECT_EQ(after.header().nxstart, 3);
            EXPECT_EQ(after.header().nystart, -4);
            EXPECT_EQ(after.header().nzstart, 5);
            EXPECT_EQ(after.sampling(), Vec3i(40, 50, 60));
            EXPECT_EQ(after.header().cell, before.header().cell);
            EXPECT_EQ(after.header().angles, before.header().angles);
            EXPECT_EQ(after.header().ispg, 4);
            EXPECT_EQ(after.header().labels,
                      (std::vector<std::string>{"made for a test", "Written by vdbgeo"}));
            EXPECT_TRUE(after.warnings().empty());
        } while (std::next_permutation(axes.begin(), axes.end()));
    }
}

TEST_F(MrcWrite, WritingTwiceChangesNothing) {
    write_bytes(in(), MrcBytes().str());
    write_mrc(load(in()), out());
    write_mrc(load(out()), folder_ / "again.mrc");
    EXPECT_TRUE(read_bytes(out()) == read_bytes(folder_ / "again.mrc"));
}

TEST_F(MrcWrite, OriginWordsComeBackWithNstart) {
    MrcBytes bytes;
    bytes.start = {1, 1, 1};
    bytes.origin = {-3.5f, 4, 5.25f};
    write_bytes(in(), bytes.str());
    write_mrc(load(in()), out());
    const MrcReader reader(out());
    EXPECT_EQ(reader.origin_rule(), "header");
    EXPECT_EQ(reader.header().origin, bytes.origin);
    EXPECT_EQ(reader.header().nxstart, 1);
}

TEST_F(MrcWrite, AnOriginThatWasOverruledStaysAway) {
    MrcBytes bytes;
    bytes.start = {1, 2, 3};
    write_bytes(in(), bytes.str());
    MrcReadOptions options;
    options.origin = OriginRule::zero;
    write_mrc(load(in(), options), out());
    EXPECT_EQ(MrcReader(out()).frame().origin, Vec3d(0, 0, 0));
    options.origin = OriginRule::given;
    options.origin_A = Vec3d(0.25, 0.5, 0.75);
    write_mrc(load(in(), options), out());
    EXPECT_EQ(MrcReader(out()).frame().origin, Vec3d(0.25, 0.5, 0.75));
}

TEST_F(MrcWrite, UnsignedBytesStayUnsigned) {
    MrcBytes bytes;
    bytes.mode = 0;
    bytes.size = {3, 1, 1};
    bytes.values = {0, 255, 128};
    bytes.set(39, 1146047817);
    write_bytes(in(), bytes.str());
    const DensityMap map = load(in());
    write_mrc(map, out());
    EXPECT_EQ(data_bytes(out()), bytes.data());
    EXPECT_EQ(MrcReader(out()).value_type(), "uint8");
    expect_flawless(out());
    MrcWriteOptions options;
    options.mode = 0;
    EXPECT_THROW(write_mrc(map, out(), options), InvalidInput) << "mode 0 on request is signed";
}

TEST_F(MrcWrite, ScaledBytesBecomeFloats) {
    MrcBytes bytes;
    bytes.mode = 0;
    bytes.set(40, -128), bytes.set(41, 127), bytes.set(20, -1.f), bytes.set(21, 1.f);
    write_bytes(in(), bytes.str());
    write_mrc(load(in()), out());
    EXPECT_EQ(MrcReader(out()).header().mode, 2);
}

TEST_F(MrcWrite, OneVolumeOfAStackIsAVolume) {
    MrcBytes bytes;
    bytes.size = {4, 3, 6};
    bytes.ispg = 401;
    bytes.sampling = {4, 3, 2};
    write_bytes(in(), bytes.str());
    MrcReadOptions options;
    options.volume = 1;
    write_mrc(load(in(), options), out());
    const MrcReader reader(out());
    EXPECT_EQ(reader.header().ispg, 1);
    EXPECT_EQ(reader.header().nz, 2);
    EXPECT_EQ(reader.header().mz, 2);
    expect_flawless(out());
}

TEST_F(MrcWrite, AStackOfImagesStaysOne) {
    MrcBytes bytes;
    bytes.size = {4, 3, 6};
    bytes.ispg = 0;
    bytes.sampling = {4, 3, 1};
    write_bytes(in(), bytes.str());
    write_mrc(load(in()), out());
    EXPECT_EQ(MrcReader(out()).header().mz, 1);
    EXPECT_EQ(MrcReader(out()).header().ispg, 0);
}

TEST_F(MrcWrite, DroppedVoxelsAndTilesHaveTheirStoredValue) {
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(-1);
    map.frame.size = Vec3i(40, 20, 30);
    map.grid->fill(openvdb::CoordBBox({8, 0, 8}, {23, 15, 23}), 5, true);  // tiles
    map.grid->getAccessor().setValueOff({9, 9, 9}, 3);
    map.grid->getAccessor().setValueOff({-3, 1, 1}, 77);  // outside the box
    write_mrc(map, out());
    const DensityMap back = load(out());
    const auto expected = map.grid->getConstAccessor(), found = back.grid->getConstAccessor();
    for (int x = 0; x < 40; ++x)
        for (int y = 0; y < 20; ++y)
            for (int z = 0; z < 30; ++z)
                ASSERT_EQ(found.getValue({x, y, z}), expected.getValue({x, y, z}))
                    << x << " " << y << " " << z;
    EXPECT_EQ(MrcReader(out()).header().dmin, -1);
    expect_flawless(out());
}

TEST_F(MrcWrite, WithoutABoxItIsThatOfTheActiveVoxels) {
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(0);
    map.frame.axes = Vec3d(2, 3, 4).asDiagonal();
    map.frame.origin = Vec3d(1, 1, 1);
    EXPECT_THROW(write_mrc(map, out()), InvalidInput);
    auto accessor = map.grid->getAccessor();
    accessor.setValue({-5, 3, 9}, 1);
    accessor.setValue({6, 4, 30}, 2);
    write_mrc(map, out());
    MrcReader reader(out());
    EXPECT_EQ(reader.frame().size, Vec3i(12, 2, 22));
    EXPECT_EQ(reader.frame().origin, Vec3d(1 - 10, 1 + 9, 1 + 36));
    std::vector<float> values(12 * 2 * 22);
    reader.read_sections(values.data(), 22);
    EXPECT_EQ(values.front(), 1);
    EXPECT_EQ(values.back(), 2);
    EXPECT_EQ(std::count(values.begin(), values.end(), 0.f), 12 * 2 * 22 - 2);
    expect_flawless(out());
}

TEST_F(MrcWrite, ValuesThatDoNotFitAreNamedAndNothingIsWritten) {
    write_bytes(out(), "old");
    const auto message = [&](const std::vector<float>& values, int mode) -> std::string {
        MrcWriteOptions options;
        options.mode = mode;
        try {
            write_mrc(small_map(values), out(), options);
        } catch (const InvalidInput& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_NE(message({1, 0.5f}, 0)
                  .find("out.mrc: the value 0.5 at voxel (1, 0, 0) does not fit into mode 0, expected "
                        "whole numbers from -128 to 127"),
              std::string::npos)
        << message({1, 0.5f}, 0);
    EXPECT_NE(message({40000}, 1).find("whole numbers from -32768 to 32767"), std::string::npos);
    EXPECT_NE(message({-1}, 6).find("whole numbers from 0 to 65535"), std::string::npos);
    EXPECT_NE(message({16}, 101).find("whole numbers from 0 to 15"), std::string::npos);
    EXPECT_NE(message({1e6f}, 12).find("numbers from -65504 to 65504"), std::string::npos);
    EXPECT_EQ(read_bytes(out()), "old");
    EXPECT_EQ(message({1, 2}, 0), "");
}

TEST_F(MrcWrite, OptionsAndMetadataAreChecked) {
    MrcWriteOptions options;
    options.mode = 4;
    EXPECT_THROW(write_mrc(small_map({1}), out(), options), InvalidInput);
    DensityMap map = small_map({1});
    map.grid->insertMeta("mrc_axes", openvdb::StringMetadata("1,1,3"));
    EXPECT_THROW(write_mrc(map, out()), InvalidInput);
    map = small_map({1});
    map.grid->insertMeta("mrc_mode", openvdb::Int32Metadata(3));
    EXPECT_THROW(write_mrc(map, out()), InvalidInput);
    EXPECT_THROW(write_mrc(DensityMap(), out()), InvalidInput);
}

TEST_F(MrcWrite, AxesThatAHeaderCannotSay) {
    DensityMap map = small_map({1});
    map.frame.axes << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    EXPECT_THROW(write_mrc(map, out()), InvalidInput);
    map.frame.axes = Vec3d(1, 1, -1).asDiagonal();
    EXPECT_THROW(write_mrc(map, out()), InvalidInput);
    map.frame.axes = Vec3d(1, 1, 0).asDiagonal();
    EXPECT_THROW(write_mrc(map, out()), InvalidInput);
    map.frame.axes.setConstant(NAN);
    EXPECT_THROW(write_mrc(map, out()), InvalidInput);
}

TEST_F(MrcWrite, AChangedVoxelSizeIsNotOverruledByMetadata) {
    MrcBytes bytes;
    bytes.sampling = {10, 20, 30};
    write_bytes(in(), bytes.str());
    DensityMap map = load(in());
    map.frame.axes *= 2;
    write_mrc(map, out());
    EXPECT_EQ(MrcReader(out()).frame().voxel_size(), Vec3d(2, 2, 2));
    EXPECT_EQ(MrcReader(out()).sampling(), Vec3i(4, 3, 2));
}

TEST_F(MrcWrite, ValuesThatAreNoNumbersSurvive) {
    write_mrc(small_map({NAN, INFINITY, 2}), out());
    MrcReader reader(out());
    EXPECT_EQ(reader.header().dmax, 2);
    std::vector<float> values(3);
    reader.read_sections(values.data(), 1);
    EXPECT_TRUE(std::isnan(values[0]));
    EXPECT_EQ(values[1], INFINITY);
    write_mrc(small_map({NAN}), out());
    EXPECT_LT(MrcReader(out()).header().dmax, MrcReader(out()).header().dmin) << "not determined";
}

TEST_F(MrcWrite, SameBytesForAnyNumberOfThreads) {
    MrcBytes bytes;
    bytes.size = {70, 60, 50};
    bytes.axes = {3, 1, 2};
    write_bytes(in(), bytes.str());
    const DensityMap map = load(in());
    std::string first;
    for (const int threads : {1, 2, 5}) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
        write_mrc(map, out());
        if (first.empty()) first = read_bytes(out());
        EXPECT_TRUE(read_bytes(out()) == first);
    }
}

TEST_F(MrcWrite, CancellingLeavesTheOldFile) {
    write_bytes(out(), "old");
    EXPECT_THROW(write_mrc(small_map({1}), out(), {}, Progress([](double f) { return f < 0.5; })), Cancelled);
    EXPECT_EQ(read_bytes(out()), "old");
}

TEST_F(MrcWrite, MrcfileAgreesThatTheFileIsFlawless) {
    const std::string python = "/usr/bin/python3 -W error -c ";
    if (std::system((python + "'import mrcfile' 2>/dev/null").c_str()) != 0)
        GTEST_SKIP() << "needs the Python package mrcfile (Debian: python3-mrcfile)";
    const auto valid = [&] {
        return std::system((python + "'import mrcfile, sys; sys.exit(not mrcfile.validate(\"" +
                            out().string() + "\"))'")
                               .c_str()) == 0;
    };
    for (const int mode : {0, 1, 2, 6, 12}) {
        MrcBytes bytes;
        bytes.mode = mode;
        bytes.size = {9, 10, 17};
        bytes.axes = {2, 3, 1};
        bytes.angles = {80, 94.326f, 120};
        bytes.start = {3, -4, 5};
        write_bytes(in(), bytes.str());
        write_mrc(load(in()), out());
        EXPECT_TRUE(valid()) << "mode " << mode;
    }
    std::string bytes = read_bytes(out());
    bytes[4 * 27] = 1;  // NVERSION
    write_bytes(out(), bytes);
    EXPECT_FALSE(valid()) << "the check can fail";
}

TEST_F(MrcWrite, RealMapsGiveBackTheirBytes) {
    for (const char* name :
         {"mrcfile/EMD-3001.map", "mrcfile/EMD-3197.map", "gemmi/5i55_tiny.ccp4", "cylindra/beta-tubulin.mrc",
          "visfd/test_blob_detect_mask.rec", "pyto/new-head_int16.mrc",
          "cctbx/ccp4_20_21_22_to_30_40_50.ccp4", "cctbx/non_zero_origin_map.ccp4", "mrcfile/float16.mrc",
          "rosettasciio/HAADFscan.mrc", "sfftk/tiny1.map", "sfftk/test_data_multi0.map", "imp/mini.mrc",
          "aspire/rln_proj_64_centered.mrcs", "multifit_groel/groel-11.5A.mrc",
          "clipper_chimerax/3io0_real_space.ccp4", "npc2018/C8_Gle1.mrc", "daq/2566_3J6B_9.mrc"}) {
        VDBGEO_NEEDS_DATA(name);
        SCOPED_TRACE(name);
        write_mrc(load(data_folder() / name), out());
        EXPECT_TRUE(data_bytes(out()) == data_bytes(data_folder() / name));
        expect_same_frame(MrcReader(out()).frame(), MrcReader(data_folder() / name).frame());
        expect_flawless(out());
    }
}

TEST_F(MrcWrite, ValidateNamesEveryDeparture) {
    const auto departs = [&](const MrcBytes& bytes, const std::string& text) {
        write_bytes(in(), bytes.str());
        const std::vector<std::string> lines = validate_mrc(in());
        EXPECT_TRUE(std::any_of(lines.begin(), lines.end(),
                                [&](const auto& line) { return line.find(text) != std::string::npos; }))
            << text << ", first of " << lines.size() << ": " << (lines.empty() ? "" : lines.front());
        EXPECT_LE(lines.size(), 2u);
    };
    write_bytes(in(), MrcBytes().str());
    expect_flawless(in());
    const auto with = [](int word, auto value) {
        MrcBytes bytes;
        bytes.set(word, value);
        return bytes;
    };
    departs(with(8, 0), "MX (word 8) is 0 for 4 samples");
    departs(with(11, 0.f), "the cell length 0 along X (word 11) gives no voxel size");
    departs(with(14, 0.f), "the cell angles (words 14-16) 0, 90, 90");
    departs(with(20, -1.f), "word 20: DMIN is -1, the data has 0");
    departs(with(21, 99.f), "word 21: DMAX is 99, the data has 15");
    departs(with(22, 99.f), "word 22: DMEAN is 99");
    departs(with(55, 99.f), "word 55: RMS is 99");
    departs(with(23, 300), "ISPG (word 23) is 300");
    departs(with(24, 80), "NSYMBT (word 24)");
    departs(with(28, 0), "word 28: NVERSION is 0");
    departs(with(50, NAN), "word 50: ORIGIN is nan");
    departs(with(56, 0), "word 56: NLABL is 0, but 1 labels have text");
    MrcBytes bytes;
    bytes.text[53] = "MAPS";
    departs(bytes, "word 53: the bytes are 4d 41 50 53");
    bytes = {};
    bytes.text[54] = std::string("\x11\x11\0\0", 4);
    departs(bytes, "word 54: the machine stamp is 11 11 00 00, expected 44 44 00 00");
    bytes = {};
    bytes.extended = std::string(80, ' ');
    bytes.exttyp = "what";
    departs(bytes, "word 27: EXTTYP");
    bytes = {};
    bytes.text[97] = "third";
    bytes.set(56, 2);
    departs(bytes, "empty labels between");
    bytes = {};
    bytes.values = std::vector<double>(24, 1);
    bytes.values[3] = NAN;
    departs(bytes, "data: 1 of 24 samples are not finite");
    write_bytes(in(), MrcBytes().str() + "+");
    EXPECT_EQ(validate_mrc(in()).size(), 1u);
    bytes = {};  // "not determined" is no departure
    bytes.set(20, 0.f), bytes.set(21, -1.f), bytes.set(22, -2.f), bytes.set(55, -1.f);
    write_bytes(in(), bytes.str());
    expect_flawless(in());
}

TEST_F(MrcWrite, ValidateLooksAtAllVolumesOfAStack) {
    MrcBytes bytes;
    bytes.size = {4, 3, 6};
    bytes.ispg = 401;
    bytes.sampling = {4, 3, 2};
    write_bytes(in(), bytes.str());
    expect_flawless(in());
}
