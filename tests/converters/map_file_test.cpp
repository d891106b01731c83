// Maps from files of either format.
#include "converters/map_file.h"

#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <cmath>
#include <cstring>

#include "converters/vdb_file.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/pack.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using openvdb::Coord;
using test::MrcBytes;
using test::TempFolder;
using test::write_bytes;

namespace {

/// 21 × 18 × 35 voxels of 1.5 Å: several slabs, none of them whole leaves only.
MrcBytes noise_bytes() {
    MrcBytes map;
    map.size = {21, 18, 35};
    map.voxel = {1.5f, 1.5f, 1.5f};
    map.origin = {10, -20, 30};
    for (const float v : test::noise(21 * 18 * 35, 41)) map.values.push_back(v);
    return map;
}

bool contains(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

bool any_contains(const std::vector<std::string>& texts, const std::string& part) {
    for (const std::string& text : texts)
        if (contains(text, part)) return true;
    return false;
}

void expect_same_grid(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b) {
    ASSERT_TRUE(a.tree().hasSameTopology(b.tree()));
    EXPECT_EQ(a.background(), b.background());
    auto p = a.cbeginValueAll(), q = b.cbeginValueAll();
    for (; p && q; ++p, ++q) ASSERT_EQ(*p, *q) << p.getCoord();
}

void expect_same_statistics(const Statistics& a, const Statistics& b) {
    EXPECT_EQ(a.count, b.count);
    EXPECT_EQ(a.non_finite, b.non_finite);
    EXPECT_EQ(a.min, b.min);
    EXPECT_EQ(a.max, b.max);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.rms, b.rms);
}

class MapFileTest : public ::testing::Test {
 protected:
    std::filesystem::path file(const std::string& bytes, const std::string& name = "a.mrc") {
        write_bytes(folder_ / name, bytes);
        return folder_ / name;
    }
    std::string refusal(const std::filesystem::path& path, const MapReadOptions& options = {}) {
        try {
            read_map(path, options);
        } catch (const InvalidInput& e) {
            return e.what();
        }
        return "";
    }
    TempFolder folder_;
};

}  // namespace

TEST_F(MapFileTest, EverySampleAndItsPlace) {
    const MrcBytes bytes = noise_bytes();
    const MapFile in = read_map(file(bytes.str()));
    EXPECT_FALSE(in.level_set);
    EXPECT_TRUE(in.warnings.empty()) << in.warnings.front();
    EXPECT_EQ(in.map.frame.size, Vec3i(21, 18, 35));
    EXPECT_EQ(in.map.frame.origin, Vec3d(10, -20, 30));
    EXPECT_EQ(in.map.frame.voxel_size(), Vec3d(1.5, 1.5, 1.5));
    EXPECT_EQ(in.map.grid->activeVoxelCount(), bytes.values.size());
    std::size_t i = 0;
    for (int z = 0; z < 35; ++z)
        for (int y = 0; y < 18; ++y)
            for (int x = 0; x < 21; ++x)
                ASSERT_EQ(in.map.grid->tree().getValue(Coord(x, y, z)), bytes.values[i++]);
}

TEST_F(MapFileTest, PackedFilesReadTheSame) {
    const std::string bytes = noise_bytes().str();
    const MapFile plain = read_map(file(bytes));
    for (const std::string& packed : {test::gzip(bytes), test::bzip2(bytes), test::zstd(bytes)}) {
        const MapFile in = read_map(file(packed, "b.mrc"));
        expect_same_grid(*plain.map.grid, *in.map.grid);
        expect_same_statistics(plain.map.statistics, in.map.statistics);
    }
}

TEST_F(MapFileTest, InvertNegatesSamplesStatisticsAndThresholds) {
    const auto path = file(noise_bytes().str());
    MapReadOptions options;
    options.invert = true;
    const MapFile plain = read_map(path), in = read_map(path, options);
    for (auto it = plain.map.grid->cbeginValueOn(); it; ++it)
        ASSERT_EQ(in.map.grid->tree().getValue(it.getCoord()), -*it);
    EXPECT_EQ(in.map.statistics.min, -plain.map.statistics.max);
    EXPECT_EQ(in.map.statistics.max, -plain.map.statistics.min);
    EXPECT_NEAR(in.map.statistics.mean, -plain.map.statistics.mean, 1e-15);
    EXPECT_NEAR(in.map.statistics.rms, plain.map.statistics.rms, 1e-15);
    options.sparsify.threshold = 0.5f;
    const MapFile kept = read_map(path, options);
    for (auto it = kept.map.grid->cbeginValueOn(); it; ++it) ASSERT_GT(*it, 0.5f);
    EXPECT_TRUE(contains(kept.map.grid->metaValue<std::string>("vdbgeo_history"), "inverted threshold 0.5"));
}

TEST_F(MapFileTest, AThresholdInSigmaIsTheOneByHand) {
    const auto path = file(noise_bytes().str());
    for (const bool invert : {false, true}) {
        MapReadOptions sigma, value;
        sigma.invert = value.invert = invert;
        sigma.threshold = ThresholdRule{ThresholdRule::Kind::sigma, 1.25};
        const Statistics s = read_map(path, value).map.statistics;
        value.sparsify.threshold = static_cast<float>(s.mean + 1.25 * s.rms);
        const MapFile a = read_map(path, sigma), b = read_map(path, value);
        EXPECT_GT(a.map.grid->activeVoxelCount(), 100u);
        expect_same_grid(*a.map.grid, *b.map.grid);
        expect_same_statistics(a.map.statistics, s);
        expect_same_statistics(mrc_statistics(path, value), s);
        EXPECT_EQ(a.map.grid->metaValue<std::string>("vdbgeo_history"),
                  b.map.grid->metaValue<std::string>("vdbgeo_history"));
    }
}

TEST_F(MapFileTest, VdbFilesKeepFrameStatisticsAndMetadata) {
    MrcBytes skewed = noise_bytes();
    skewed.angles = {90, 101.5f, 90};
    skewed.axes = {3, 1, 2};
    for (const std::string& bytes : {noise_bytes().str(), skewed.str()}) {
        MapReadOptions options;
        options.sparsify.threshold = 0.25f;
        const MapFile in = read_map(file(bytes), options);
        write_vdb({in.map.grid}, folder_ / "a.vdb");
        const MapFile back = read_map(folder_ / "a.vdb");
        EXPECT_EQ(back.map.frame.axes, in.map.frame.axes);
        EXPECT_EQ(back.map.frame.origin, in.map.frame.origin);
        EXPECT_EQ(back.map.frame.size, in.map.frame.size);
        expect_same_statistics(back.map.statistics, in.map.statistics);
        expect_same_grid(*back.map.grid, *in.map.grid);
        for (auto it = in.map.grid->beginMeta(); it != in.map.grid->endMeta(); ++it)
            EXPECT_EQ((*back.map.grid)[it->first]->str(), it->second->str()) << it->first;
        EXPECT_TRUE(back.warnings.empty());
    }
}

TEST_F(MapFileTest, ALevelSetIsFlagged) {
    const auto sphere = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(8, openvdb::Vec3f(0), 0.5f);
    write_vdb({sphere}, folder_ / "a.vdb");
    const MapFile in = read_map(folder_ / "a.vdb");
    EXPECT_TRUE(in.level_set);
    EXPECT_FALSE(in.map.frame.bounded());
    EXPECT_EQ(in.map.frame.voxel_size(), Vec3d(0.5, 0.5, 0.5));
    EXPECT_EQ(in.map.statistics.count, sphere->activeVoxelCount());
}

TEST_F(MapFileTest, OptionsThatHaveNoMeaningForAVdbFileAreWarnedOf) {
    write_vdb({test::map_from_values(Vec3i(9, 9, 9), test::noise(729, 1)).grid}, folder_ / "a.vdb");
    MapReadOptions threshold, sigma, background, invert, voxel, origin;
    threshold.sparsify.threshold = 0.1f;
    sigma.threshold = ThresholdRule{ThresholdRule::Kind::sigma, 1};
    background.sparsify.background = 0;
    invert.invert = true;
    voxel.mrc.voxel_size_A = Vec3d(2, 2, 2);
    origin.mrc.origin = OriginRule::zero;
    for (const MapReadOptions* o : {&threshold, &sigma, &background, &invert})
        EXPECT_TRUE(any_contains(read_map(folder_ / "a.vdb", *o).warnings, "taken as it is"));
    for (const MapReadOptions* o : {&voxel, &origin})
        EXPECT_TRUE(any_contains(read_map(folder_ / "a.vdb", *o).warnings, "where its transform says"));
    EXPECT_EQ(read_map(folder_ / "a.vdb", voxel).map.frame.voxel_size(), Vec3d(1, 1, 1));
}

TEST_F(MapFileTest, WarningsTellOfOddFiles) {
    MrcBytes odd = noise_bytes();
    odd.values[5] = std::nan("");
    odd.values[6000] = INFINITY;
    odd.voxel = {0, 0, 0};
    const MapFile in = read_map(file(odd.str()));
    EXPECT_TRUE(any_contains(in.warnings, "2 samples are not finite"));
    EXPECT_GE(in.warnings.size(), 2u);  // and the cell
    EXPECT_EQ(in.map.statistics.non_finite, 2u);
}

TEST_F(MapFileTest, AFaultThatTheReaderMeetsOnTheWayIsTheCallers) {
    const std::string packed = test::gzip(noise_bytes().str());
    for (const double part : {0.2, 0.5, 0.9, 0.999}) {
        const auto cut = static_cast<std::size_t>(part * static_cast<double>(packed.size()));
        const std::string message = refusal(file(packed.substr(0, cut), "cut.mrc.gz"));
        EXPECT_TRUE(contains(message, "cut.mrc.gz") && contains(message, "ends early")) << message;
    }
    std::string broken = packed;
    for (std::size_t i = broken.size() / 2; i < broken.size() / 2 + 50; ++i) broken[i] = 'x';
    EXPECT_NE(refusal(file(broken, "broken.mrc.gz")), "");
}

TEST_F(MapFileTest, CancellingStopsInTheMiddle) {
    const auto path = file(noise_bytes().str());
    MapReadOptions plain, sigma;
    sigma.threshold = ThresholdRule{ThresholdRule::Kind::sigma, 1};
    for (const MapReadOptions* o : {&plain, &sigma})
        for (const double at : {0.1, 0.6, 0.9}) {
            double last = 0;
            const Progress stop([&](double done) { return last = done, done < at; });
            EXPECT_THROW(read_map(path, *o, stop), Cancelled);
            EXPECT_LT(last, at + 0.3);
        }
}

TEST_F(MapFileTest, BadOptionsAndFilesAreRefused) {
    const auto path = file(noise_bytes().str());
    MapReadOptions two, odd, grid, sigma;
    two.threshold = ThresholdRule{ThresholdRule::Kind::sigma, 1};
    two.sparsify.threshold = 1.f;
    EXPECT_TRUE(contains(refusal(path, two), "two thresholds"));
    odd.threshold = ThresholdRule{ThresholdRule::Kind::sigma, INFINITY};
    EXPECT_NE(refusal(path, odd), "");
    write_vdb({test::map_from_values(Vec3i(9, 9, 9), test::noise(729, 1)).grid}, folder_ / "a.vdb");
    grid.grid = "other";
    EXPECT_TRUE(contains(refusal(folder_ / "a.vdb", grid), "no grid 'other' among 'density'"));
    EXPECT_THROW(read_map(folder_ / "none.mrc"), IoError);
    sigma.threshold = ThresholdRule{ThresholdRule::Kind::sigma, 1};
    EXPECT_THROW(read_map(folder_ / "none.mrc", sigma), IoError);
    auto frustum = openvdb::FloatGrid::create();
    frustum->setName("lens");
    frustum->tree().setValue(Coord(1, 1, 1), 1);
    frustum->setTransform(openvdb::math::Transform::createFrustumTransform(
        openvdb::BBoxd(openvdb::Vec3d(0), openvdb::Vec3d(10)), 0.5, 10, 1));
    write_vdb({frustum}, folder_ / "f.vdb");
    const std::string message = refusal(folder_ / "f.vdb");
    EXPECT_TRUE(contains(message, "grid 'lens'") && contains(message, "not linear")) << message;
}

TEST(MapFile, EndingsTellMaps) {
    for (const char* name : {"a.mrc", "A.MRC", "b.map.gz", "c.ccp4.bz2", "d.rec.zst", "e.st", "f.mrcs"})
        EXPECT_TRUE(is_map_ending(name)) << name;
    for (const char* name : {"a.vdb", "mrc", "a.gz", "a.ply", "a.mrc.txt", ""})
        EXPECT_FALSE(is_map_ending(name)) << name;
    EXPECT_TRUE(is_vdb_ending("x/a.VDB"));
    EXPECT_FALSE(is_vdb_ending("a.vdb.gz"));
}

TEST(MapFile, StatisticsOfRealMaps) {
    struct Known {
        const char* name;
        std::uint64_t count;
        double min, max, mean, rms;
    };
    const Known known[] = {
        {"sfftk/emd_5625.map", 56 * 56 * 56, -1.4999780654907227, 7.940685272216797, 0.2521620413958749,
         0.8693210241376956},
        {"cylindra/beta-tubulin.mrc", 8000, -1.0822834968566895, 7.637046813964844, 0.060288116603673475,
         0.40510678247982046},
        {"mrcfile/EMD-3197.map", 8000, -4.1337456703186035, 5.576736927032471, 0.7836120336436434,
         2.39995290849429},
        {"pymol/emd_1155.ccp4", 141 * 91 * 281, -128, 127, 5.038940388754881, 12.399856037303747}};
    for (const Known& k : known) {
        VDBGEO_NEEDS_DATA(k.name);
        for (const bool sparse : {false, true}) {
            MapReadOptions options;
            if (sparse) options.threshold = ThresholdRule{ThresholdRule::Kind::sigma, 2};
            const Statistics s = read_map(test::data_folder() / k.name, options).map.statistics;
            EXPECT_EQ(s.count, k.count) << k.name;
            EXPECT_EQ(s.non_finite, 0u);
            EXPECT_EQ(s.min, k.min) << k.name;
            EXPECT_EQ(s.max, k.max) << k.name;
            EXPECT_NEAR(s.mean, k.mean, 1e-12 * k.rms) << k.name;
            EXPECT_NEAR(s.rms, k.rms, 1e-12 * k.rms) << k.name;
        }
    }
}
