#include "converters/mrc_samples.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

using namespace vdbgeo;

namespace {

// IEEE 754 binary16, straight from its definition.
double half_by_definition(std::uint32_t half) {
    const int exponent = static_cast<int>(half >> 10 & 31), mantissa = static_cast<int>(half & 1023);
    const double sign = half & 0x8000 ? -1 : 1;
    if (exponent == 31) return mantissa ? std::nan("") : sign * INFINITY;
    if (exponent == 0) return sign * std::ldexp(mantissa, -24);
    return sign * std::ldexp(1024 + mantissa, exponent - 25);
}

}  // namespace

TEST(MrcSamples, EveryHalfReadsAsDefinedAndGoesBack) {
    for (std::uint32_t half = 0; half < 65536; ++half) {
        const float value = half_to_float(static_cast<std::uint16_t>(half));
        const double expected = half_by_definition(half);
        if (std::isnan(expected))
            EXPECT_TRUE(std::isnan(value)) << half;
        else
            EXPECT_EQ(value, expected) << half;
        EXPECT_EQ(float_to_half(value), half);
    }
}

TEST(MrcSamples, FloatToHalfRoundsToNearestEven) {
    for (std::uint32_t half = 0; half < 0x7bff; half += 7) {
        const double low = half_by_definition(half), high = half_by_definition(half + 1);
        const float middle = static_cast<float>((low + high) / 2);
        EXPECT_EQ(float_to_half(middle), half + half % 2);
        EXPECT_EQ(float_to_half(std::nextafter(middle, 1e9f)), half + 1);
        EXPECT_EQ(float_to_half(std::nextafter(middle, -1e9f)), half);
    }
    EXPECT_EQ(float_to_half(65519.f), 0x7bff);
    EXPECT_EQ(float_to_half(65520.f), 0x7c00);
    EXPECT_EQ(float_to_half(-1e30f), 0xfc00);
}

TEST(MrcSamples, IntegersRefuseWhatTheyCannotHold) {
    struct Case {
        SampleType type;
        double low, high;
    };
    for (const Case c : {Case{SampleType::int8, -128, 127}, Case{SampleType::uint8, 0, 255},
                         Case{SampleType::int16, -32768, 32767}, Case{SampleType::uint16, 0, 65535},
                         Case{SampleType::uint4, 0, 15}}) {
        const float low = static_cast<float>(c.low), high = static_cast<float>(c.high);
        std::array<unsigned char, 8> out{};
        const std::array<float, 3> good{low, 1, high};
        ASSERT_EQ(floats_to_samples(c.type, good.data(), out.data(), 3), 3u);
        std::array<float, 3> back{};
        samples_to_float(c.type, false, out.data(), back.data(), 3);
        EXPECT_EQ(back, good);
        for (const float bad : {low - 1, high + 1, 0.5f, std::nanf(""), INFINITY}) {
            const std::array<float, 3> values{1, bad, 1};
            EXPECT_EQ(floats_to_samples(c.type, values.data(), out.data(), 3), 1u)
                << name_of(c.type) << " " << bad;
        }
    }
}

TEST(MrcSamples, HalvesRefuseWhatOverflowsButKeepInfinity) {
    std::array<unsigned char, 8> out{};
    const std::array<float, 3> good{65504, -INFINITY, std::nanf("")}, bad{1, 65520, 1};
    EXPECT_EQ(floats_to_samples(SampleType::float16, good.data(), out.data(), 3), 3u);
    EXPECT_EQ(floats_to_samples(SampleType::float16, bad.data(), out.data(), 3), 1u);
}

TEST(MrcSamples, FourBitSamplesStartInTheLowHalf) {
    const std::array<unsigned char, 2> bytes{0x21, 0xf3};
    std::array<float, 3> out{};
    samples_to_float(SampleType::uint4, false, bytes.data(), out.data(), 3);
    EXPECT_EQ(out, (std::array<float, 3>{1, 2, 3}));
    std::array<unsigned char, 2> back{0xff, 0xff};
    floats_to_samples(SampleType::uint4, out.data(), back.data(), 3);
    EXPECT_EQ(back, (std::array<unsigned char, 2>{0x21, 0x03}));
    EXPECT_EQ(row_bytes(SampleType::uint4, 3), 2u);
}

TEST(MrcSamples, SwappedBytes) {
    const std::array<unsigned char, 4> shorts{0xff, 0xfe, 0x01, 0x02};
    std::array<float, 2> out{};
    samples_to_float(SampleType::int16, true, shorts.data(), out.data(), 2);
    EXPECT_EQ(out, (std::array<float, 2>{-2, 258}));
    samples_to_float(SampleType::uint16, true, shorts.data(), out.data(), 2);
    EXPECT_EQ(out, (std::array<float, 2>{65534, 258}));
    const std::array<unsigned char, 4> real{0x3f, 0x80, 0, 0};
    samples_to_float(SampleType::float32, true, real.data(), out.data(), 1);
    EXPECT_EQ(out[0], 1);
    const std::array<unsigned char, 2> half{0x3c, 0};
    samples_to_float(SampleType::float16, true, half.data(), out.data(), 1);
    EXPECT_EQ(out[0], 1);
}
