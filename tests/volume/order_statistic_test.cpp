#include "vdbgeo/volume/order_statistic.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

constexpr float inf = std::numeric_limits<float>::infinity();
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

/// Hands over the values in portions of `portion` in each pass; the number of passes that were needed.
int feed(OrderStatistic& statistic, const std::vector<float>& values, std::size_t portion) {
    int passes = 0;
    for (; !statistic.done(); ++passes) {
        for (std::size_t i = 0; i < values.size(); i += portion)
            statistic.add(values.data() + i, std::min(portion, values.size() - i));
        statistic.end_pass();
    }
    return passes;
}

float percentile(const std::vector<float>& values, double fraction, std::size_t portion = 1 << 20) {
    OrderStatistic statistic(fraction);
    EXPECT_LE(feed(statistic, values, portion), OrderStatistic::passes);
    return statistic.value();
}

/// The same by the textbook.
float sorted_percentile(std::vector<float> values, double fraction) {
    values.erase(std::remove_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v); }),
                 values.end());
    const double n = static_cast<double>(values.size());
    const auto rank = static_cast<std::ptrdiff_t>(std::max(0.0, std::ceil(fraction * n) - 1));
    std::nth_element(values.begin(), values.begin() + rank, values.end());
    return values[static_cast<std::size_t>(rank)];
}

const std::vector<double> fractions{0, 1e-9, 0.001, 0.25, 0.5, 0.9, 0.995, 0.999999, 1};

TEST(OrderStatistic, IsWhatNthElementFinds) {
    std::mt19937_64 random(7);
    std::vector<std::vector<float>> sets;
    sets.push_back(test::noise(100000, 1));
    sets.push_back(test::noise(70001, 2));
    for (float& v : sets.back()) v = std::round(v * 3);  // many ties
    sets.push_back({});
    for (int i = 0; i < 50000; ++i) {  // any bits at all: subnormals, infinities, NaN of both signs
        const auto bits = static_cast<std::uint32_t>(random());
        float v;
        std::memcpy(&v, &bits, sizeof v);
        sets.back().push_back(v);
    }
    sets.push_back(std::vector<float>(333, 1.5e-41f));
    for (const std::vector<float>& values : sets)
        for (const double fraction : fractions) {
            SCOPED_TRACE(fraction);
            EXPECT_EQ(percentile(values, fraction), sorted_percentile(values, fraction));
            EXPECT_EQ(percentile(values, fraction, 777), sorted_percentile(values, fraction));
        }
}

TEST(OrderStatistic, FewSamples) {
    for (std::size_t n = 1; n <= 40; ++n)
        for (const double fraction : fractions) {
            const std::vector<float> values = test::noise(n, n);
            EXPECT_EQ(percentile(values, fraction), sorted_percentile(values, fraction))
                << n << " " << fraction;
        }
    EXPECT_EQ(percentile({1, 2, 3, 4}, 0.5), 2);
    EXPECT_EQ(percentile({1, 2, 3, 4}, 0.51), 3);
}

TEST(OrderStatistic, ExtremesAndZeros) {
    const float largest = std::numeric_limits<float>::max();
    EXPECT_EQ(percentile({inf, -largest, largest, -inf, nan}, 0), -largest);
    EXPECT_EQ(percentile({inf, -largest, largest, -inf, -nan}, 1), largest);
    const float zero = percentile({-0.0f, 0.0f, -0.0f}, 0);
    EXPECT_EQ(zero, 0);
    EXPECT_FALSE(std::signbit(zero));
    EXPECT_EQ(percentile({-1, -0.0f, 0.0f, 1}, 0.5), 0);
    EXPECT_EQ(percentile({-std::numeric_limits<float>::denorm_min(), 0, 1}, 0),
              -std::numeric_limits<float>::denorm_min());
}

TEST(OrderStatistic, BytesNeedOnePass) {
    std::vector<float> bytes;
    for (int i = -255; i <= 255; ++i) bytes.push_back(static_cast<float>(i));
    for (const double fraction : fractions) {
        OrderStatistic statistic(fraction);
        EXPECT_EQ(feed(statistic, bytes, 100), 1);
        EXPECT_EQ(statistic.value(), sorted_percentile(bytes, fraction));
        EXPECT_EQ(statistic.count(), 511u);
    }
    bytes.push_back(1.00001f);
    OrderStatistic statistic(0.5);
    EXPECT_EQ(feed(statistic, bytes, 100), 2);
    EXPECT_EQ(statistic.value(), 0);
}

TEST(OrderStatistic, NothingFinite) {
    for (const std::vector<float>& values : {std::vector<float>{}, {nan, -nan, inf, -inf}}) {
        OrderStatistic statistic(0.5);
        EXPECT_EQ(feed(statistic, values, 8), 1);
        EXPECT_EQ(statistic.count(), 0u);
        EXPECT_THROW(statistic.value(), InvalidInput);
    }
}

TEST(OrderStatistic, Misuse) {
    EXPECT_THROW(OrderStatistic(-0.1), InvalidInput);
    EXPECT_THROW(OrderStatistic(1.1), InvalidInput);
    EXPECT_THROW(OrderStatistic{static_cast<double>(nan)}, InvalidInput);
    OrderStatistic statistic(0.5);
    const std::vector<float> first{1.1f, 2.2f, 3.3f}, second{1.1f, 3.3f};
    statistic.add(first.data(), first.size());
    EXPECT_THROW(statistic.value(), std::logic_error);
    statistic.end_pass();
    statistic.add(second.data(), second.size());
    EXPECT_THROW(statistic.end_pass(), InvalidInput);
}

TEST(OrderStatistic, AnyNumberOfThreads) {
    const std::vector<float> values = test::noise(1000003, 5);
    for (const std::size_t threads : {1, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        for (const double fraction : fractions)
            EXPECT_EQ(percentile(values, fraction), sorted_percentile(values, fraction)) << threads;
    }
}

}  // namespace
}  // namespace vdbgeo
