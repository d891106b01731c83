#include "vdbgeo/volume/density_histogram.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using test::map_from_values;
using test::noise;

const Vec3i n(19, 13, 21);
constexpr std::size_t samples = 19 * 13 * 21;

}  // namespace

TEST(DensityHistogram, CountsEverySampleInItsBin) {
    const std::vector<float> values = noise(samples, 4);
    const DensityHistogram h = density_histogram(map_from_values(n, values), 50);
    ASSERT_EQ(h.counts.size(), 50u);
    EXPECT_EQ(h.low, double(*std::min_element(values.begin(), values.end())));
    EXPECT_EQ(h.high, double(*std::max_element(values.begin(), values.end())));
    std::vector<std::uint64_t> expected(50, 0);
    for (const float v : values)
        ++expected[std::min<std::size_t>(
            49, static_cast<std::size_t>(50 * (double(v) - h.low) / (h.high - h.low)))];
    EXPECT_EQ(h.counts, expected);
    EXPECT_EQ(h.voxels, samples);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(density_histogram(map_from_values(n, values), 50).counts, expected);
}

TEST(DensityHistogram, OfASparseMapCountsWhatWasKept) {
    const std::vector<float> values = noise(samples, 4);
    SparsifyOptions some;
    some.threshold = 0.5f;
    const DensityMap map = map_from_values(n, values, {}, some);
    const DensityHistogram h = density_histogram(map, 10);
    EXPECT_EQ(h.voxels, map.grid->activeVoxelCount());
    EXPECT_EQ(std::accumulate(h.counts.begin(), h.counts.end(), std::uint64_t{0}), h.voxels);
    EXPECT_GE(h.low, 0.5);
}

TEST(DensityHistogram, WholeNumbersLieInTheMiddleOfTheirBins) {
    std::vector<float> values(samples);
    for (std::size_t i = 0; i < samples; ++i) values[i] = static_cast<float>(i % 7) - 2;
    const DensityMap map = map_from_values(n, values);
    const DensityHistogram h = density_histogram(map, 200);
    EXPECT_EQ(h.low, -2.5);
    EXPECT_EQ(h.high, 4.5);
    ASSERT_EQ(h.counts.size(), 7u);
    for (const std::uint64_t c : h.counts) EXPECT_EQ(c, samples / 7);
    const DensityHistogram few = density_histogram(map, 3);  // three numbers a bin
    EXPECT_EQ(few.high, 6.5);
    EXPECT_EQ(few.counts, (std::vector<std::uint64_t>{samples * 3 / 7, samples * 3 / 7, samples / 7}));
}

TEST(DensityHistogram, ScaledBytesFillTheirBinsEvenly) {
    std::vector<float> values(samples);
    for (std::size_t i = 0; i < samples; ++i)
        values[i] = 0.0055899792f * static_cast<float>(static_cast<int>(i % 247) - 100) + 0.19921453f;
    const DensityMap map = map_from_values(n, values);
    const DensityHistogram h = density_histogram(map, 220);  // 247 levels: two a bin
    ASSERT_EQ(h.counts.size(), 124u);
    for (std::size_t i = 0; i < 123; ++i) EXPECT_EQ(h.counts[i], 2 * samples / 247) << i;
    EXPECT_EQ(h.counts[123], samples / 247);
    EXPECT_NEAR(h.low, values[0] - 0.0028, 1e-4);
    // One value that fits in nowhere: no steps.
    std::vector<float> torn = values;
    torn[0] = 0.2012f;
    EXPECT_EQ(density_histogram(map_from_values(n, torn), 220).counts.size(), 220u);
}

TEST(DensityHistogram, OfOneValueAndOfNone) {
    const DensityHistogram one = density_histogram(map_from_values(n, std::vector<float>(samples, 0.3f)), 9);
    EXPECT_EQ(one.counts, std::vector<std::uint64_t>{samples});
    EXPECT_LT(one.low, 0.3f);
    EXPECT_GT(one.high, 0.3f);
    std::vector<float> values(samples, 1.5f);
    values[5] = std::numeric_limits<float>::quiet_NaN();
    values[6] = std::numeric_limits<float>::infinity();
    values[7] = 2.5f;
    const DensityHistogram damaged = density_histogram(map_from_values(n, values), 4);
    EXPECT_EQ(damaged.non_finite, 2u);
    EXPECT_EQ(damaged.counts, (std::vector<std::uint64_t>{samples - 3, 1}));  // two levels
    DensityMap empty;
    empty.grid = openvdb::FloatGrid::create();
    EXPECT_THROW(density_histogram(empty, 4), InvalidInput);
    EXPECT_THROW(density_histogram(map_from_values(n, values), 0), InvalidInput);
}

}  // namespace vdbgeo
