#include "vdbgeo/volume/resample.h"

#include <gtest/gtest.h>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using test::map_from_function;
using test::map_from_values;
using test::noise;

TEST(SampleOn, BoxesOfOneSizeGoIndexForIndexWhateverTheirHeadersSay) {
    const Vec3i size(17, 9, 12);
    Frame own, other;
    own.axes *= 3.54;
    own.size = other.size = size;
    SparsifyOptions some;
    some.threshold = 0.0f;
    const DensityMap reference = map_from_values(size, noise(17 * 9 * 12, 1), own, some);
    const DensityMap second = map_from_values(size, noise(17 * 9 * 12, 2), other);
    const SampledMap sampled = sample_on(second, reference, "resolution");
    EXPECT_TRUE(sampled.by_index);
    EXPECT_TRUE(sampled.frames_differ);
    EXPECT_EQ(sampled.outside, 0u);
    EXPECT_EQ(sampled.grid->getName(), "resolution");
    EXPECT_EQ(sampled.grid->transform(), reference.grid->transform());
    EXPECT_EQ(sampled.grid->activeVoxelCount(), reference.grid->activeVoxelCount());
    for (auto it = reference.grid->cbeginValueOn(); it; ++it)
        ASSERT_EQ(sampled.grid->tree().getValue(it.getCoord()), second.grid->tree().getValue(it.getCoord()));
    EXPECT_FALSE(sample_on(second, map_from_values(size, noise(17 * 9 * 12, 1), other), "m").frames_differ);
}

TEST(SampleOn, OtherBoxesGoByPosition) {
    const auto field = [](const Vec3d& p) { return 1 + 0.5 * p.x() - 0.25 * p.y() + 2 * p.z(); };
    Frame own, other;
    own.axes *= 1.5;
    own.origin = Vec3d(3, 2, 1);
    own.size = Vec3i(8, 8, 8);
    other.axes << 1, 0.2, 0, 0, 0.7, 0, 0.1, 0, 0.9;  // covers the first box
    other.origin = Vec3d(-5, -5, -5);
    other.size = Vec3i(40, 40, 40);
    const DensityMap reference = map_from_function(own.size, own, field);
    const DensityMap second = map_from_function(other.size, other, field);
    const SampledMap sampled = sample_on(second, reference, "same");
    EXPECT_FALSE(sampled.by_index);
    EXPECT_EQ(sampled.outside, 0u);
    for (auto it = reference.grid->cbeginValueOn(); it; ++it)
        ASSERT_NEAR(sampled.grid->tree().getValue(it.getCoord()), *it, 1e-4);  // trilinear is exact here
}

TEST(SampleOn, OutsideTheOtherBoxReadsAsItsBackgroundAndIsCounted) {
    Frame own, other;
    own.size = Vec3i(16, 4, 4);
    other.size = Vec3i(8, 8, 8);
    SparsifyOptions background;
    background.background = -3.0f;
    const DensityMap reference = map_from_values(own.size, std::vector<float>(256, 1.0f), own);
    const DensityMap second = map_from_values(other.size, std::vector<float>(512, 5.0f), other, background);
    const SampledMap sampled = sample_on(second, reference, "mask");
    EXPECT_EQ(sampled.outside, 8u * 16u);
    EXPECT_EQ(sampled.grid->tree().getValue(openvdb::Coord(7, 0, 0)), 5.0f);
    EXPECT_EQ(sampled.grid->tree().getValue(openvdb::Coord(8, 0, 0)), -3.0f);
    EXPECT_THROW(sample_on(second, reference, ""), InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
