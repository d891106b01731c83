// Maps gone through piece by piece: against a plain model of what crop, bin, scales, thresholds, masks,
// despeckling and halos mean, and the same bytes however much memory there is.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "converters/map_copy.h"
#include "converters/map_file.h"
#include "converters/mrc.h"
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

/// A dense box of values along x, y, z, some of them kept.
struct Model {
    Vec3i size;
    std::vector<float> values;
    std::vector<char> kept;

    std::size_t at(int x, int y, int z) const {
        return (static_cast<std::size_t>(z) * static_cast<std::size_t>(size.y()) +
                static_cast<std::size_t>(y)) *
                   static_cast<std::size_t>(size.x()) +
               static_cast<std::size_t>(x);
    }
    template <class Visit>
    void each(const Visit& visit) const {
        for (int z = 0; z < size.z(); ++z)
            for (int y = 0; y < size.y(); ++y)
                for (int x = 0; x < size.x(); ++x) visit(x, y, z);
    }
    bool inside(int x, int y, int z) const {
        return x >= 0 && y >= 0 && z >= 0 && x < size.x() && y < size.y() && z < size.z();
    }
};

/// The samples of a map made by MrcBytes, in x, y, z order.
Model model_of(const MrcBytes& bytes) {
    Model m;
    for (int k = 0; k < 3; ++k)
        m.size[bytes.axes[static_cast<std::size_t>(k)] - 1] = bytes.size[static_cast<std::size_t>(k)];
    m.values.resize(static_cast<std::size_t>(m.size.prod()));
    const std::vector<double> all = bytes.all_values();
    std::size_t i = 0;
    for (int s = 0; s < bytes.size[2]; ++s)
        for (int r = 0; r < bytes.size[1]; ++r)
            for (int c = 0; c < bytes.size[0]; ++c) {
                std::array<int, 3> index{};
                index[static_cast<std::size_t>(bytes.axes[0] - 1)] = c;
                index[static_cast<std::size_t>(bytes.axes[1] - 1)] = r;
                index[static_cast<std::size_t>(bytes.axes[2] - 1)] = s;
                m.values[m.at(index[0], index[1], index[2])] = static_cast<float>(all[i++]);
            }
    return m;
}

Model cropped(const Model& in, const Vec3i& begin, const Vec3i& end) {
    Model m;
    m.size = end - begin;
    m.values.resize(static_cast<std::size_t>(m.size.prod()));
    m.each([&](int x, int y, int z) {
        m.values[m.at(x, y, z)] = in.values[in.at(x + begin.x(), y + begin.y(), z + begin.z())];
    });
    return m;
}

Model binned(const Model& in, int n) {
    Model m;
    m.size = in.size / n;
    m.values.resize(static_cast<std::size_t>(m.size.prod()));
    m.each([&](int x, int y, int z) {
        double sum = 0;
        for (int k = 0; k < n; ++k)
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i) sum += in.values[in.at(n * x + i, n * y + j, n * z + k)];
        m.values[m.at(x, y, z)] = static_cast<float>(sum / (double(n) * n * n));
    });
    return m;
}

void despeckle(Model& m, std::size_t least) {
    std::vector<int> piece(m.values.size(), -1);
    int count = 0;
    m.each([&](int x, int y, int z) {
        if (!m.kept[m.at(x, y, z)] || piece[m.at(x, y, z)] >= 0) return;
        std::vector<std::array<int, 3>> found{{x, y, z}};
        piece[m.at(x, y, z)] = count;
        for (std::size_t i = 0; i < found.size(); ++i)
            for (const auto& step :
                 {std::array<int, 3>{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}) {
                const int a = found[i][0] + step[0], b = found[i][1] + step[1], c = found[i][2] + step[2];
                if (!m.inside(a, b, c) || !m.kept[m.at(a, b, c)] || piece[m.at(a, b, c)] >= 0) continue;
                piece[m.at(a, b, c)] = count;
                found.push_back({a, b, c});
            }
        ++count;
        if (found.size() < least)
            for (const auto& p : found) m.kept[m.at(p[0], p[1], p[2])] = 0;
    });
}

void grow(Model& m, int n) {
    const std::vector<char> before = m.kept;
    m.each([&](int x, int y, int z) {
        for (int k = -n; k <= n; ++k)
            for (int j = -n; j <= n; ++j)
                for (int i = -n; i <= n; ++i)
                    if (m.inside(x + i, y + j, z + k) && before[m.at(x + i, y + j, z + k)])
                        m.kept[m.at(x, y, z)] = 1;
    });
}

void expect_map(const DensityMap& map, const Model& m) {
    ASSERT_EQ(map.frame.size, m.size);
    std::uint64_t active = 0;
    m.each([&](int x, int y, int z) {
        const std::size_t i = m.at(x, y, z);
        const Coord c(x, y, z);
        ASSERT_EQ(map.grid->tree().isValueOn(c), m.kept[i] != 0) << c;
        if (m.kept[i]) {
            ASSERT_EQ(map.grid->tree().getValue(c), m.values[i]) << c;
            ++active;
        }
    });
    EXPECT_EQ(map.grid->activeVoxelCount(), active);
}

class MapStream : public ::testing::Test {
 protected:
    /// 43 × 37 × 29 samples of smoothed noise, whole numbers where the mode wants them.
    MrcBytes noise_map(int mode = 2, std::array<std::int32_t, 3> axes = {1, 2, 3}) {
        MrcBytes map;
        map.size = {43, 37, 29};
        map.mode = mode;
        map.axes = axes;
        map.origin = {10, -20, 30};
        map.voxel = {2, 2, 2};
        for (const float v : test::noise(43 * 37 * 29, 7))
            map.values.push_back(mode == 2 ? double(v)
                                           : std::floor(mode == 101 ? 8 + 7 * v
                                                        : mode == 6 ? 30000 + 30000 * v
                                                                    : 100 * v));
        return map;
    }
    std::filesystem::path file(const std::string& bytes, const std::string& name = "a.mrc") {
        write_bytes(folder_ / name, bytes);
        return folder_ / name;
    }
    std::string bytes_of(const std::string& name) { return test::read_bytes(folder_ / name); }
    void write_streamed(const std::filesystem::path& in, MapReadOptions options, const std::string& out,
                        std::uint64_t memory, const VdbWriteOptions& vdb = {}) {
        options.memory = memory;
        options.scratch = folder_.path();
        const MapFile map = stream_map(in, options, vdb);
        write_vdb({map.map.grid}, folder_ / out, vdb);
    }
    /// The file of a stream is that of a map in memory, for any memory, number of threads and packing.
    void expect_same_files(const MrcBytes& bytes, const MapReadOptions& options,
                           const VdbWriteOptions& vdb = {}) {
        const auto in = file(bytes.str());
        write_vdb({read_map(in, options).map.grid}, folder_ / "whole.vdb", vdb);
        const std::string whole = bytes_of("whole.vdb");
        write_streamed(in, options, "large.vdb", std::uint64_t(4) << 30, vdb);
        EXPECT_TRUE(bytes_of("large.vdb") == whole);
        write_streamed(in, options, "small.vdb", std::uint64_t(64) << 20, vdb);
        EXPECT_TRUE(bytes_of("small.vdb") == whole);
        const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
        write_streamed(in, options, "one.vdb", std::uint64_t(64) << 20, vdb);
        EXPECT_TRUE(bytes_of("one.vdb") == whole);
        const auto packed = file(test::gzip(bytes.str()), "a.mrc");  // the name is in the metadata
        write_streamed(packed, options, "packed.vdb", std::uint64_t(64) << 20, vdb);
        EXPECT_TRUE(bytes_of("packed.vdb") == whole);
        // And as a map file.
        const DensityMap map = read_map(packed, options).map;
        write_mrc(map, folder_ / "whole.mrc");
        copy_map(packed, folder_ / "copy.mrc", options, {});
        EXPECT_TRUE(bytes_of("copy.mrc") == bytes_of("whole.mrc"));
        EXPECT_GT(bytes_of("copy.mrc").size(), 1024u);
    }
    static MapReadOptions above(float threshold) {
        MapReadOptions options;
        options.sparsify.threshold = threshold;
        return options;
    }
    TempFolder folder_;
};

}  // namespace

TEST_F(MapStream, EveryModeAndAxisOrderGivesTheSameFileAnyWay) {
    for (const int mode : {0, 1, 2, 6, 12, 101})
        for (const std::array<std::int32_t, 3>& axes :
             {std::array<std::int32_t, 3>{1, 2, 3}, {3, 1, 2}, {2, 1, 3}, {3, 2, 1}}) {
            MrcBytes bytes = noise_map(mode, axes);
            bytes.big_endian = mode == 1 || mode == 6;
            SCOPED_TRACE(fmt::format("mode {} axes {}{}{}", mode, axes[0], axes[1], axes[2]));
            Model m = model_of(bytes);
            if (mode == 12)
                for (float& v : m.values) v = std::floor(v);
            m.kept.assign(m.values.size(), 1);
            expect_map(read_map(file(bytes.str())).map, m);
            if (mode == 1 || axes[0] == 1) expect_same_files(bytes, {});
        }
}

TEST_F(MapStream, ThresholdsBandsAndQuantisationGiveTheSameFileAnyWay) {
    MapReadOptions band = above(0.2f), sigma, percentile, fraction, quantised = above(0.3f),
                   inverted = above(0.1f);
    band.sparsify.band = 0.25f;
    sigma.threshold = ThresholdRule{ThresholdRule::Kind::sigma, 0.7};
    percentile.threshold = ThresholdRule{ThresholdRule::Kind::percentile, 80};
    fraction.threshold = ThresholdRule{ThresholdRule::Kind::fraction, 0.1};
    quantised.quantise = ThresholdRule{ThresholdRule::Kind::value, 0.1};
    inverted.invert = true;
    for (const MapReadOptions& options :
         {above(0.9f), band, sigma, percentile, fraction, quantised, inverted})
        expect_same_files(noise_map(), options);
    VdbWriteOptions zip, none;
    zip.compression = VdbWriteOptions::Compression::zip;
    none.compression = VdbWriteOptions::Compression::none;
    none.half = true;
    expect_same_files(noise_map(), above(0.2f), zip);
    expect_same_files(noise_map(), above(0.2f), none);
}

TEST_F(MapStream, ConstantBlocksBecomeTiles) {
    MrcBytes bytes = noise_map(1);
    const Model m = model_of(bytes);
    for (int z = 0; z < 29; ++z)
        for (int y = 0; y < 37; ++y)
            for (int x = 0; x < 43; ++x)
                bytes.values[m.at(x, y, z)] = x < 24 && y < 24 && z < 24 ? 500 : x < 32 && z < 16 ? -3 : 40;
    MapReadOptions band = above(30);  // 40 is kept, 500 lies above
    band.sparsify.band = 20.f;
    const DensityMap map = read_map(file(bytes.str()), above(100)).map;
    EXPECT_EQ(map.grid->tree().leafCount(), 0u);
    EXPECT_EQ(map.grid->activeVoxelCount(), 24u * 24 * 24);
    for (const MapReadOptions& options : {MapReadOptions(), above(100), band})
        expect_same_files(bytes, options);
}

TEST_F(MapStream, CropAndBinAgreeWithThePlainWay) {
    for (const int mode : {1, 2, 101})
        for (const std::array<std::int32_t, 3>& axes : {std::array<std::int32_t, 3>{1, 2, 3}, {3, 1, 2}}) {
            const MrcBytes bytes = noise_map(mode, axes);
            const Model whole = model_of(bytes);
            for (const int bin : {1, 2, 3}) {
                MapReadOptions options;
                options.crop.emplace();
                options.crop->begin = {3, std::nullopt, 1};
                options.crop->end = {27, std::nullopt, 22};
                options.bin = bin;
                SCOPED_TRACE(fmt::format("mode {} bin {} first axis {}", mode, bin, axes[0]));
                Model m = cropped(whole, Vec3i(3, 0, 1), Vec3i(27, whole.size.y(), 22));
                if (bin > 1) m = binned(m, bin);
                m.kept.assign(m.values.size(), 1);
                const MapFile in = read_map(file(bytes.str()), options);
                expect_map(in.map, m);
                // The first voxel's centre is that of its block of samples.
                const Vec3d first(3 + 0.5 * (bin - 1), 0.5 * (bin - 1), 1 + 0.5 * (bin - 1));
                EXPECT_TRUE(in.map.frame.origin.isApprox(Vec3d(10, -20, 30) + 2 * first, 1e-6));
                EXPECT_TRUE(in.map.frame.voxel_size().isApprox(Vec3d::Constant(2.0 * bin), 1e-6));
                EXPECT_EQ(in.warnings.empty(), bin == 1);
                expect_same_files(bytes, options);
            }
        }
}

TEST_F(MapStream, BinnedConstantAndRampKeepTheirValuesInTheWorld) {
    // The mean of a linear function over a block is its value at the block's centre.
    MrcBytes bytes = noise_map();
    const Model m = model_of(bytes);
    m.each([&](int x, int y, int z) { bytes.values[m.at(x, y, z)] = 2.0 * x - 3.0 * y + z; });
    MapReadOptions options;
    options.bin = 4;
    const DensityMap map = read_map(file(bytes.str()), options).map;
    for (const Coord& c : {Coord(0, 0, 0), Coord(5, 2, 6), Coord(9, 8, 6)}) {
        const Vec3d old = (map.frame.to_world(Vec3d(c.x(), c.y(), c.z())) - Vec3d(10, -20, 30)) / 2;
        EXPECT_NEAR(map.grid->tree().getValue(c), 2 * old.x() - 3 * old.y() + old.z(), 1e-4);
    }
}

TEST_F(MapStream, NormalisedMapsHaveTheStatisticsAskedFor) {
    for (const int mode : {1, 2}) {
        const auto path = file(noise_map(mode).str());
        const Statistics raw = read_map(path).map.statistics;
        MapReadOptions options;
        options.normalise = MapReadOptions::Normalise::sigma;
        const DensityMap sigma = read_map(path, options).map;
        EXPECT_NEAR(sigma.statistics.mean, 0, 1e-6);
        EXPECT_NEAR(sigma.statistics.rms, 1, 1e-6);
        const float before = read_map(path).map.grid->tree().getValue(Coord(5, 6, 7));
        EXPECT_FLOAT_EQ(sigma.grid->tree().getValue(Coord(5, 6, 7)),
                        static_cast<float>((before - raw.mean) / raw.rms));
        options.normalise = MapReadOptions::Normalise::range;
        const DensityMap range = read_map(path, options).map;
        EXPECT_EQ(range.statistics.min, 0);
        EXPECT_EQ(range.statistics.max, 1);
        options.sparsify.threshold = 0.75f;
        expect_same_files(noise_map(mode), options);
    }
    MrcBytes flat = noise_map();
    std::fill(flat.values.begin(), flat.values.end(), 3.0);
    MapReadOptions options;
    options.normalise = MapReadOptions::Normalise::sigma;
    EXPECT_THROW(read_map(file(flat.str()), options), InvalidInput);
}

TEST_F(MapStream, PercentileAndFractionKeepWhatTheySay) {
    const MrcBytes bytes = noise_map();
    const auto path = file(bytes.str());
    const double n = static_cast<double>(bytes.values.size());
    MapReadOptions all;
    all.threshold = ThresholdRule{ThresholdRule::Kind::fraction, 1};
    EXPECT_EQ(read_map(path, all).map.grid->activeVoxelCount(), bytes.values.size());
    for (const double percent : {0.0, 10.0, 50.0, 99.0}) {
        MapReadOptions options;
        options.threshold = ThresholdRule{ThresholdRule::Kind::percentile, percent};
        const double kept = static_cast<double>(read_map(path, options).map.grid->activeVoxelCount());
        EXPECT_NEAR(kept, n * (1 - percent / 100), 1.5) << percent;
        MapReadOptions fraction;
        fraction.threshold = ThresholdRule{ThresholdRule::Kind::fraction, 1 - percent / 100};
        EXPECT_NEAR(static_cast<double>(read_map(path, fraction).map.grid->activeVoxelCount()), kept, 1.5);
    }
}

TEST_F(MapStream, MaskDespeckleAndHaloAgreeWithThePlainWay) {
    for (const std::array<std::int32_t, 3>& axes : {std::array<std::int32_t, 3>{1, 2, 3}, {2, 3, 1}}) {
        const MrcBytes bytes = noise_map(2, axes);
        MrcBytes mask = noise_map(0, {1, 2, 3});
        const Model whole = model_of(bytes);
        mask.size = {whole.size.x(), whole.size.y(), whole.size.z()};
        for (std::size_t i = 0; i < mask.values.size(); ++i)
            mask.values[i] = i % 43 < 30 ? 1 : i % 2 ? 0 : -5;
        const Model allowed = model_of(mask);
        for (const bool with_mask : {false, true})
            for (const std::uint64_t pieces : {std::uint64_t(0), std::uint64_t(12)})
                for (const int halo : {0, 2}) {
                    SCOPED_TRACE(fmt::format("mask {} despeckle {} halo {} first axis {}", with_mask, pieces,
                                             halo, axes[0]));
                    MapReadOptions options = above(0.35f);
                    if (with_mask) options.mask = file(mask.str(), "mask.mrc");
                    options.despeckle = pieces;
                    options.halo = halo;
                    Model m = whole;
                    m.kept.resize(m.values.size());
                    for (std::size_t i = 0; i < m.kept.size(); ++i)
                        m.kept[i] = m.values[i] > 0.35f && (!with_mask || allowed.values[i] > 0);
                    if (pieces > 0) despeckle(m, pieces);
                    if (halo > 0) grow(m, halo);
                    expect_map(read_map(file(bytes.str()), options).map, m);
                    if (pieces > 0 && halo > 0) expect_same_files(bytes, options);
                }
    }
}

TEST_F(MapStream, MaskAloneKeepsEverythingInIt) {
    const MrcBytes bytes = noise_map();
    MrcBytes mask = noise_map(0);
    for (std::size_t i = 0; i < mask.values.size(); ++i) mask.values[i] = i % 5 == 0;
    MapReadOptions options;
    options.mask = file(mask.str(), "mask.mrc");
    Model m = model_of(bytes);
    m.kept.resize(m.values.size());
    for (std::size_t i = 0; i < m.kept.size(); ++i) m.kept[i] = i % 5 == 0;
    expect_map(read_map(file(bytes.str()), options).map, m);
    // The same mask as a VDB file, and of a map that is cropped.
    write_vdb({read_map(folder_ / "mask.mrc").map.grid}, folder_ / "mask.vdb");
    options.mask = folder_ / "mask.vdb";
    expect_map(read_map(file(bytes.str()), options).map, m);
    MapReadOptions cut = options;
    cut.crop.emplace();
    cut.crop->begin[0] = 1;  // a grid cannot be cut like the map
    EXPECT_THROW(read_map(file(bytes.str()), cut), InvalidInput);
    mask.size = {43, 37, 28};
    mask.values.resize(43 * 37 * 28);
    options.mask = file(mask.str(), "other.mrc");
    EXPECT_THROW(read_map(file(bytes.str()), options), InvalidInput);
}

TEST_F(MapStream, WhatMakesNoSenseIsRefused) {
    const auto path = file(noise_map().str());
    const auto refused = [&](const MapReadOptions& options) {
        EXPECT_THROW(read_map(path, options), InvalidInput);
        EXPECT_THROW(stream_map(path, options, {}), InvalidInput);
        EXPECT_THROW(copy_map(path, folder_ / "never.mrc", options, {}), InvalidInput);
    };
    MapReadOptions bin, large_bin, crop, halo, band = above(0.1f), memory;
    bin.bin = 0;
    large_bin.bin = 30;  // only 29 sections
    crop.crop.emplace();
    crop.crop->end[2] = 30;
    halo.halo = 2;  // around what?
    band.sparsify.band = 0.1f;
    band.despeckle = 3;
    memory.memory = 1 << 20;
    for (const auto& options : {bin, large_bin, crop, halo, band, memory}) refused(options);
    crop.crop->end[2] = 5;
    crop.crop->begin[2] = 5;
    refused(crop);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "never.mrc"));
    EXPECT_THROW(copy_map(path, folder_ / "never.mrc", above(9), {}), NumericalError);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "never.mrc"));
}

TEST_F(MapStream, HalfRangeIsCheckedBeforeAnythingIsWritten) {
    MrcBytes bytes = noise_map();
    bytes.values[1234] = 70000;
    VdbWriteOptions halves;
    halves.half = true;
    try {
        stream_map(file(bytes.str()), {}, halves);
        FAIL() << "70000 fits into 16 bits";
    } catch (const InvalidInput& e) {
        EXPECT_NE(std::string(e.what()).find("70000"), std::string::npos) << e.what();
    }
}

TEST_F(MapStream, LeavesOfSeveralNodesAreStoredInTheOrderOfTheTree) {
    // 300 samples along each axis in turn: three nodes of 128 that way.
    for (const std::array<std::int32_t, 3>& size :
         {std::array<std::int32_t, 3>{300, 20, 20}, {20, 300, 20}, {20, 20, 300}, {150, 150, 30}}) {
        MrcBytes bytes = noise_map();
        bytes.size = size;
        bytes.values.clear();
        for (const float v : test::noise(static_cast<std::size_t>(size[0] * size[1] * size[2]), 3))
            bytes.values.push_back(v);
        expect_same_files(bytes, above(0.8f));
    }
}

TEST_F(MapStream, TilesAndBackgroundAreHeldAgainstTheRangeOfHalvesToo) {
    MrcBytes bytes = noise_map();
    const Model m = model_of(bytes);
    m.each(
        [&](int x, int y, int z) { bytes.values[m.at(x, y, z)] = x < 8 && y < 8 && z < 8 ? 1e6 : x * 0.5; });
    VdbWriteOptions halves;
    halves.half = true;
    EXPECT_THROW(stream_map(file(bytes.str()), {}, halves), InvalidInput);
    for (double& v : bytes.values) v = v > 20 ? v : -1e6;
    EXPECT_THROW(stream_map(file(bytes.str()), above(0), halves), InvalidInput);
}

TEST_F(MapStream, PercentilesOfVeryWideMapsAreExact) {
    MrcBytes bytes;
    bytes.size = {9001, 20, 17};
    for (const float v : test::noise(9001 * 20 * 17, 13)) bytes.values.push_back(v);
    std::vector<double> sorted = bytes.values;
    std::sort(sorted.begin(), sorted.end());
    const auto path = file(bytes.str());
    for (const double percent : {55.0, 95.0}) {
        MapReadOptions options;
        options.threshold = ThresholdRule{ThresholdRule::Kind::percentile, percent};
        const double level =
            sorted[static_cast<std::size_t>(std::ceil(percent * double(sorted.size()) / 100)) - 1];
        const auto kept =
            static_cast<std::uint64_t>(sorted.end() - std::upper_bound(sorted.begin(), sorted.end(), level));
        EXPECT_EQ(read_map(path, options).map.grid->activeVoxelCount(), kept);
    }
}

TEST_F(MapStream, TheStartOfACropIsCountedFromTheFilesOwn) {
    MrcBytes bytes = noise_map(2, {3, 1, 2});
    bytes.origin = {0, 0, 0};
    bytes.start = {-10, 20, 5};
    const auto path = file(bytes.str());
    MapReadOptions options;
    options.crop.emplace();
    options.crop->begin = {1, 2, 3};
    copy_map(path, folder_ / "crop.mrc", options, {});
    const MrcReader cropped(folder_ / "crop.mrc");
    EXPECT_EQ(cropped.origin_rule(), "nstart");
    EXPECT_EQ(cropped.header().nxstart, -10 + 3);  // columns run along z, rows along x, sections along y
    EXPECT_EQ(cropped.header().nystart, 20 + 1);
    EXPECT_EQ(cropped.header().nzstart, 5 + 2);
    EXPECT_TRUE(cropped.frame().origin.isApprox(read_map(path, options).map.frame.origin, 1e-6));
    options.bin = 2;
    copy_map(path, folder_ / "bin.mrc", options, {});
    const MrcReader reader(folder_ / "bin.mrc");
    EXPECT_EQ(reader.header().nxstart, 0);
    EXPECT_TRUE(reader.frame().origin.isApprox(read_map(path, options).map.frame.origin, 1e-6));
}

TEST_F(MapStream, InvertedUnsignedNumbersAreWrittenAsFloats) {
    const auto path = file(noise_map(6).str());
    MapReadOptions options;
    options.invert = true;
    EXPECT_EQ(copy_map(path, folder_ / "i.mrc", options, {}).report.mode, 2);
    EXPECT_EQ(copy_map(file(noise_map(1).str()), folder_ / "s.mrc", options, {}).report.mode, 1);
}

TEST_F(MapStream, NoNumberBlocksDoNotHideTheErrorOfRounding) {
    MrcBytes bytes = noise_map();
    const Model m = model_of(bytes);
    m.each([&](int x, int y, int z) {
        if (x < 8 && y < 8 && z < 8) bytes.values[m.at(x, y, z)] = NAN;
    });
    MapReadOptions options;
    options.quantise = ThresholdRule{ThresholdRule::Kind::value, 0.25};
    const MapFile in = read_map(file(bytes.str()), options);
    EXPECT_GT(in.rounding.largest, 0.12);
    EXPECT_LE(in.rounding.largest, 0.125);
}

TEST_F(MapStream, ABandThatKeepsNothingKeepsNothingEitherWay) {
    MapReadOptions band = above(-50);
    band.sparsify.band = 1.f;
    const auto path = file(noise_map().str());
    EXPECT_EQ(stream_map(path, band, {}).map.grid->activeVoxelCount(), 0u);
    EXPECT_THROW(copy_map(path, folder_ / "never.mrc", band, {}), NumericalError);
}
