#include "vdbgeo/volume/fog.h"

#include <gtest/gtest.h>
#include <openvdb/tools/Diagnostics.h>

#include <cmath>
#include <limits>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using test::map_from_values;

const Vec3i odd_size(19, 13, 11);

std::vector<float> ramp(std::size_t count) {
    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i) values[i] = 0.01f * static_cast<float>(i % 401) - 1.0f;
    return values;
}

DensityMap ramp_map(const SparsifyOptions& sparsify = {}) {
    return map_from_values(odd_size, ramp(19 * 13 * 11), {}, sparsify);
}

double number(const openvdb::GridBase& grid, const char* key) {
    const auto entry = grid.getMetadata<openvdb::DoubleMetadata>(key);
    return entry ? entry->value() : std::numeric_limits<double>::quiet_NaN();
}

/// What the map's definition of fog gives for one sample.
float expected(float v, double low, double high) {
    return v > low ? static_cast<float>(std::min(1.0, (v - low) / (high - low))) : 0.0f;
}

TEST(Fog, EverySampleIsMappedClippedAndDropped) {
    const DensityMap map = ramp_map();
    const auto fog = fog_volume(map, FogRange{0.5, 2.25});
    std::uint64_t active = 0;
    for (int x = 0; x < 19; ++x)
        for (int y = 0; y < 13; ++y)
            for (int z = 0; z < 11; ++z) {
                const openvdb::Coord ijk(x, y, z);
                const float v = map.grid->tree().getValue(ijk);
                ASSERT_NEAR(fog->tree().getValue(ijk), expected(v, 0.5, 2.25), 1e-6f) << ijk;
                ASSERT_EQ(fog->tree().isValueOn(ijk), v > 0.5f) << ijk;
                active += v > 0.5f;
            }
    EXPECT_EQ(fog->activeVoxelCount(), active);  // nothing outside the box
    EXPECT_EQ(fog->background(), 0.0f);
    EXPECT_EQ(openvdb::tools::checkFogVolume(*fog), "");
}

TEST(Fog, IsNamedAndKeepsItsMapping) {
    const DensityMap map = ramp_map();
    const auto fog = fog_volume(map, FogRange{0.5, 2.25});
    EXPECT_EQ(fog->getName(), "density");
    EXPECT_EQ(fog->getGridClass(), openvdb::GRID_FOG_VOLUME);
    EXPECT_EQ(number(*fog, "vdbgeo_fog_low"), 0.5);
    EXPECT_EQ(number(*fog, "vdbgeo_fog_high"), 2.25);
    EXPECT_EQ(map_from_grid(fog).frame.size, odd_size);
    EXPECT_EQ(map.grid->background(), ramp_map().grid->background());  // the map itself is untouched
    EXPECT_EQ(map.grid->activeVoxelCount(), 19u * 13u * 11u);
}

TEST(Fog, DefaultsAreTwoRmsAndTheMaximum) {
    std::vector<float> values = ramp(19 * 13 * 11);
    values[77] = 20;
    const DensityMap map = map_from_values(odd_size, values);
    const FogRange range = fog_range(map.statistics);
    EXPECT_DOUBLE_EQ(range.low, map.statistics.mean + 2 * map.statistics.rms);
    EXPECT_DOUBLE_EQ(range.high, map.statistics.max);
}

TEST(Fog, AMaskIsFogToo) {
    std::vector<float> values(19 * 13 * 11, 0.0f);
    std::fill(values.begin(), values.begin() + 1300, 1.0f);  // mean + 2 rms lies beyond 1
    const DensityMap map = map_from_values(odd_size, values);
    ASSERT_GT(map.statistics.mean + 2 * map.statistics.rms, 1.0);
    const auto fog = fog_volume(map);
    EXPECT_EQ(fog->activeVoxelCount(), 1300u);
    EXPECT_EQ(fog->tree().getValue(openvdb::Coord(0, 0, 0)), 1.0f);
}

TEST(Fog, WhatWasDroppedStaysClearAndTheInsideOfABandIsOpaque) {
    SparsifyOptions band;
    band.threshold = 1.0f;
    band.band = 0.25f;
    band.background = -1.0f;  // above the fog's lower level
    const DensityMap map = ramp_map(band);
    const auto fog = fog_volume(map, FogRange{-2, 1});
    for (int x = 0; x < 19; ++x)
        for (int z = 0; z < 11; ++z) {
            const openvdb::Coord ijk(x, 7, z);
            const float v = ramp(19 * 13 * 11)[static_cast<std::size_t>(x + 19 * (7 + 13 * z))];
            const float want = v <= 0.75f ? 0.0f : expected(v, -2, 1);
            ASSERT_NEAR(fog->tree().getValue(ijk), want, 1e-6f) << v;
        }
    EXPECT_FALSE(fog->tree().isValueOn(openvdb::Coord(100, 0, 0)));
}

TEST(Fog, ConstantBlocksBecomeTiles) {
    const DensityMap map = map_from_values(Vec3i(64, 64, 64), std::vector<float>(64 * 64 * 64, 3.0f));
    const auto fog = fog_volume(map, FogRange{0, 1});
    EXPECT_EQ(fog->tree().leafCount(), 0u);
    EXPECT_EQ(fog->activeVoxelCount(), 64u * 64u * 64u);
    EXPECT_EQ(fog->tree().getValue(openvdb::Coord(63, 0, 63)), 1.0f);
}

TEST(Fog, WhatIsNoNumberIsClear) {
    std::vector<float> values = ramp(19 * 13 * 11);
    values[5] = std::numeric_limits<float>::quiet_NaN();
    values[6] = std::numeric_limits<float>::infinity();
    const auto fog = fog_volume(map_from_values(odd_size, values), FogRange{0, 1});
    EXPECT_FALSE(fog->tree().isValueOn(openvdb::Coord(5, 0, 0)));
    EXPECT_EQ(openvdb::tools::checkFogVolume(*fog), "");
}

TEST(Fog, ARangeThatDoesNotRiseIsRefused) {
    const DensityMap map = ramp_map();
    EXPECT_THROW(fog_volume(map, FogRange{1, 1}), InvalidInput);
    EXPECT_THROW(fog_volume(map, FogRange{2, 1}), InvalidInput);
    FogOptions above;
    above.low = {Isovalue::Rule::value, 1e9};
    EXPECT_THROW(fog_volume(map, above), InvalidInput);
    map.grid->setGridClass(openvdb::GRID_LEVEL_SET);
    EXPECT_THROW(fog_volume(map, FogRange{0, 1}), InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
