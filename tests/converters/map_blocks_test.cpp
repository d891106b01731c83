// Maps read box after box have the bits of maps read whole.
#include "converters/map_blocks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "converters/map_parts.h"
#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/pack.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/placement.h"

using namespace vdbgeo;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using test::MrcBytes;

namespace {

bool same_bits(float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; }

void expect_same_statistics(const Statistics& a, const Statistics& b) {
    EXPECT_EQ(a.count, b.count);
    EXPECT_EQ(a.non_finite, b.non_finite);
    EXPECT_EQ(a.min, b.min);
    EXPECT_EQ(a.max, b.max);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.rms, b.rms);
}

void expect_same_head(const DensityMap& part, const DensityMap& whole) {
    EXPECT_EQ(part.frame.size, whole.frame.size);
    EXPECT_EQ(part.frame.origin, whole.frame.origin);
    EXPECT_EQ(part.frame.axes, whole.frame.axes);
    expect_same_statistics(part.statistics, whole.statistics);
    EXPECT_TRUE(same_bits(part.grid->background(), whole.grid->background()));
    EXPECT_EQ(part.grid->transform(), whole.grid->transform());
    EXPECT_EQ(part.grid->getName(), whole.grid->getName());
    EXPECT_EQ(part.grid->getGridClass(), whole.grid->getGridClass());
    const openvdb::MetaMap &a = *part.grid, &b = *whole.grid;
    EXPECT_EQ(a.metaCount(), b.metaCount());
    for (auto entry = b.beginMeta(); entry != b.endMeta(); ++entry) {
        ASSERT_TRUE(a[entry->first]) << entry->first;
        EXPECT_EQ(a[entry->first]->str(), entry->second->str()) << entry->first;
    }
}

/// The leaves that touch the box and no others, and every voxel of the box.
void expect_part(const FloatGrid& part, const FloatGrid& whole, const CoordBBox& box) {
    for (auto leaf = part.tree().cbeginLeaf(); leaf; ++leaf)
        ASSERT_TRUE(leaf->getNodeBoundingBox().hasOverlap(box)) << leaf->origin();
    for (auto leaf = whole.tree().cbeginLeaf(); leaf; ++leaf) {
        if (!leaf->getNodeBoundingBox().hasOverlap(box)) continue;
        const auto* other = part.tree().probeConstLeaf(leaf->origin());
        ASSERT_TRUE(other) << leaf->origin();
        EXPECT_EQ(other->getValueMask(), leaf->getValueMask());
        EXPECT_EQ(std::memcmp(other->buffer().data(), leaf->buffer().data(), 512 * sizeof(float)), 0)
            << leaf->origin();
    }
    const auto a = part.getConstAccessor(), b = whole.getConstAccessor();
    const int step = box.volume() > 1000000 ? 3 : 1;
    Coord at;
    for (at.x() = box.min().x(); at.x() <= box.max().x(); at.x() += step)
        for (at.y() = box.min().y(); at.y() <= box.max().y(); at.y() += step)
            for (at.z() = box.min().z(); at.z() <= box.max().z(); at.z() += step) {
                ASSERT_TRUE(same_bits(a.getValue(at), b.getValue(at))) << at;
                ASSERT_EQ(a.isValueOn(at), b.isValueOn(at)) << at;
            }
}

class MapBlocksTest : public ::testing::Test {
 protected:
    static MrcBytes noise(int mode = 2, std::array<std::int32_t, 3> axes = {1, 2, 3}) {
        MrcBytes map;
        map.size = {43, 37, 29};
        map.mode = mode;
        map.axes = axes;
        map.origin = {10, -20, 30};
        map.voxel = {2, 2, 2};
        for (const float v : test::noise(43 * 37 * 29, 7))
            map.values.push_back(mode == 2 ? double(v) : std::floor(100 * v));
        if (mode == 2) map.values[777] = std::numeric_limits<double>::quiet_NaN();
        return map;
    }

    std::filesystem::path file(const std::string& bytes) {
        test::write_bytes(folder_ / "a.mrc", bytes);
        return folder_ / "a.mrc";
    }

    /// All of it, slabs, pencils, a corner that is not at multiples of 8, beyond the ends, one voxel.
    static std::vector<CoordBBox> boxes(const CoordBBox& all) {
        const Coord low = all.min(), high = all.max(), middle = low.offsetBy(high.x() / 2);
        return {all,
                {low, {high.x(), low.y() + 7, high.z()}},
                {{low.x() + 8, low.y(), low.z()}, {low.x() + 15, high.y(), high.z()}},
                {{low.x() + 13, low.y() + 9, low.z() + 3}, {low.x() + 26, low.y() + 20, low.z() + 14}},
                {high.offsetBy(-9), high.offsetBy(40)},
                {low.offsetBy(-40), low.offsetBy(4)},
                {middle, middle},
                {low, {high.x(), high.y(), low.z() + 7}},
                {high.offsetBy(300), high.offsetBy(310)}};
    }

    void expect_blocks(const std::filesystem::path& path, MapReadOptions options = {}) {
        options.scratch = folder_.path();
        const MapFile whole = read_map(path, options);
        const MapBlocks blocks(path, options);
        expect_same_head(blocks.whole().map, whole.map);
        EXPECT_EQ(blocks.whole().warnings, whole.warnings);
        EXPECT_EQ(blocks.whole().level_set, whole.level_set);
        EXPECT_EQ(blocks.whole().quantisation, whole.quantisation);
        EXPECT_EQ(blocks.whole().rounding.largest, whole.rounding.largest);
        EXPECT_EQ(blocks.whole().map.grid->tree().leafCount(), 0u);
        for (const CoordBBox& box : boxes(blocks.box())) {
            SCOPED_TRACE(fmt::format("{},{},{} to {},{},{}", box.min().x(), box.min().y(), box.min().z(),
                                     box.max().x(), box.max().y(), box.max().z()));
            const DensityMap part = blocks.read(box);
            expect_same_head(part, whole.map);
            expect_part(*part.grid, *whole.map.grid, box);
        }
        // All of it is in the box.
        const DensityMap all = blocks.read(CoordBBox::inf());
        EXPECT_EQ(all.grid->activeVoxelCount(), whole.map.grid->activeVoxelCount());
        EXPECT_EQ(all.grid->tree().leafCount(), whole.map.grid->tree().leafCount());
        const CoordBBox active = whole.map.grid->evalActiveVoxelBoundingBox();
        EXPECT_TRUE(active.empty() || blocks.box().isInside(active) || whole.map.frame.bounded());
    }

    test::TempFolder folder_;
};

}  // namespace

TEST_F(MapBlocksTest, EveryAxisOrderAndKindOfSamples) {
    for (const int mode : {0, 1, 2})
        for (const std::array<std::int32_t, 3>& axes :
             {std::array<std::int32_t, 3>{1, 2, 3}, {1, 3, 2}, {2, 1, 3}, {2, 3, 1}, {3, 1, 2}, {3, 2, 1}}) {
            SCOPED_TRACE(fmt::format("mode {} axes {}{}{}", mode, axes[0], axes[1], axes[2]));
            MrcBytes bytes = noise(mode, axes);
            bytes.big_endian = mode == 1;
            expect_blocks(file(bytes.str()));
        }
    expect_blocks(file(test::gzip(noise().str())));
}

TEST_F(MapBlocksTest, WhateverIsDoneToTheSamples) {
    using Kind = ThresholdRule::Kind;
    MapReadOptions value, sigma, percentile, fraction, band, quantised, cropped, binned, scaled, selected;
    value.sparsify.threshold = 0.9f;
    sigma.threshold = ThresholdRule{Kind::sigma, 0.7};
    percentile.threshold = ThresholdRule{Kind::percentile, 80};
    fraction.threshold = ThresholdRule{Kind::fraction, 0.01};
    fraction.halo = 2;
    band.sparsify.threshold = 0.2f;
    band.sparsify.band = 0.25f;
    quantised.sparsify.threshold = 0.3f;
    quantised.quantise = ThresholdRule{Kind::sigma, 0.1};
    cropped.crop.emplace();
    cropped.crop->begin = {3, std::nullopt, 1};
    cropped.crop->end = {27, std::nullopt, 22};
    cropped.invert = true;
    binned.bin = 2;
    binned.crop = cropped.crop;
    scaled.normalise = MapReadOptions::Normalise::sigma;
    scaled.sparsify.threshold = 0.5f;
    selected.sparsify.threshold = 0.8f;
    selected.despeckle = 3;
    int number = 0;
    for (const MapReadOptions& options :
         {value, sigma, percentile, fraction, band, quantised, cropped, binned, scaled, selected}) {
        SCOPED_TRACE(++number);
        expect_blocks(file(noise().str()), options);
        expect_blocks(file(noise(1, {3, 1, 2}).str()), options);
    }
    MapReadOptions masked;
    MrcBytes mask = noise();
    mask.values[777] = 0;
    test::write_bytes(folder_ / "mask.mrc", mask.str());
    masked.mask = folder_ / "mask.mrc";
    expect_blocks(file(noise().str()), masked);
}

TEST_F(MapBlocksTest, ConstantBlocksAreTiles) {
    MrcBytes bytes = noise(1);
    for (std::size_t i = 0; i < bytes.values.size(); ++i) {
        const std::size_t x = i % 43, z = i / (43 * 37);
        bytes.values[i] = x < 24 && z < 16 ? 500 : 40;
    }
    MapReadOptions above;
    above.sparsify.threshold = 100.f;
    for (const MapReadOptions& options : {MapReadOptions(), above}) expect_blocks(file(bytes.str()), options);
}

TEST_F(MapBlocksTest, GridsWithTilesOnEveryLevel) {
    auto grid = FloatGrid::create(-1);
    grid->setName("odd");
    FloatGrid::TreeType& tree = grid->tree();
    tree.addTile(2, Coord(128, 0, 0), 3, true);
    tree.addTile(2, Coord(-128, 0, 0), 6, false);
    tree.addTile(1, Coord(8, 8, 8), 4, false);
    tree.addTile(1, Coord(-16, -8, 24), 5, true);
    for (int i = 0; i < 200; ++i) tree.setValue(Coord(i - 100, 3 * i % 47 - 20, i * i % 61 - 30), float(i));
    tree.setValueOff(Coord(-3, -3, -3), 9);
    // Statistics are computed; the number and order of the additions make their last bits.
    write_vdb({grid}, folder_ / "a.vdb");
    expect_blocks(folder_ / "a.vdb");
    // They are noted, and there is a box.
    SparsifyOptions some;
    some.threshold = 0.2f;
    const DensityMap map = test::map_from_values(Vec3i(150, 41, 33), test::noise(150 * 41 * 33, 7), {}, some);
    write_vdb({map.grid}, folder_ / "a.vdb");
    expect_blocks(folder_ / "a.vdb");
    // Nothing at all.
    write_vdb({FloatGrid::create(2)}, folder_ / "a.vdb");
    const MapBlocks nothing(folder_ / "a.vdb");
    EXPECT_TRUE(nothing.box().empty());
    EXPECT_TRUE(nothing.read(CoordBBox::inf()).grid->tree().empty());
}

TEST_F(MapBlocksTest, LevelSetsAndGridsThatWerePlaced) {
    auto ball = openvdb::tools::createLevelSetSphere<FloatGrid>(30.f, openvdb::Vec3f(5, 6, 7), 1.f);
    write_vdb({ball}, folder_ / "a.vdb");
    expect_blocks(folder_ / "a.vdb");
    place(*ball, {});
    write_vdb({ball}, folder_ / "a.vdb");
    expect_blocks(folder_ / "a.vdb");
}

TEST_F(MapBlocksTest, FoldersOfParts) {
    const DensityMap map = test::map_from_values(Vec3i(50, 70, 140), test::noise(50 * 70 * 140, 3));
    std::filesystem::create_directory(folder_ / "a.parts");
    int number = 0;
    for (const CoordBBox& own :
         {CoordBBox(Coord(0), Coord(63, 31, 127)), CoordBBox(Coord(0, 32, 0), Coord(63, 95, 127)),
          CoordBBox(Coord(0, 0, 128), Coord(63, 95, 255))})
        write_map_part(map, own, number++, folder_ / "a.parts");
    expect_blocks(folder_ / "a.parts");
    const MapBlocks blocks(folder_ / "a.parts");
    for (const CoordBBox& box : boxes(blocks.box())) expect_part(*blocks.read(box).grid, *map.grid, box);
}

TEST_F(MapBlocksTest, VoxelsBeyondTheBoxAreRefusedWhereAsked) {
    const DensityMap map = test::map_from_values(Vec3i(30, 20, 10), test::noise(30 * 20 * 10, 3));
    map.grid->tree().setValue(Coord(31, 23, 15), 1);  // in the box's last leaf
    write_vdb({map.grid}, folder_ / "a.vdb");
    EXPECT_NO_THROW(MapBlocks(folder_ / "a.vdb").require_active_in_box());
    map.grid->tree().setValue(Coord(5, 24, 3), 1);
    write_vdb({map.grid}, folder_ / "a.vdb");
    EXPECT_THROW(MapBlocks(folder_ / "a.vdb").require_active_in_box(), InvalidInput);
}

TEST_F(MapBlocksTest, ErrorsAreThoseOfReadMap) {
    EXPECT_THROW(MapBlocks(folder_ / "none.mrc"), IoError);
    EXPECT_THROW(MapBlocks(folder_.path()), InvalidInput);
    EXPECT_THROW(MapBlocks(file("short")), InvalidInput);
    EXPECT_THROW(MapBlocks(file(noise().str().substr(0, 5000))), InvalidInput);
    MapReadOptions far;
    far.crop.emplace();
    far.crop->begin[0] = 100;
    EXPECT_THROW(MapBlocks(file(noise().str()), far), InvalidInput);
    EXPECT_THROW(MapBlocks(file(noise().str()), {}, Progress([](double) { return false; })), Cancelled);
}
