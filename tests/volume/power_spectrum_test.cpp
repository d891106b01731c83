#include "vdbgeo/volume/power_spectrum.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <complex>
#include <limits>
#include <map>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using test::centred_frame;
using test::map_from_function;
using test::map_from_values;
using test::noise;

constexpr double pi = 3.14159265358979323846;

/// |Σ (u − ū) exp(−2πi k·x/n)|² / N over shells, coefficient by coefficient, of a map without a taper.
std::map<long, std::pair<double, int>> direct(const Vec3i& n, const std::vector<float>& values,
                                              const Vec3d& voxel, double width) {
    std::map<long, std::pair<double, int>> shells;
    double mean = 0;
    for (const float v : values) mean += double(v) / static_cast<double>(values.size());
    for (int kz = 0; kz < n.z(); ++kz)
        for (int ky = 0; ky < n.y(); ++ky)
            for (int kx = 0; kx < n.x(); ++kx) {
                std::complex<double> sum = 0;
                std::size_t i = 0;
                for (int z = 0; z < n.z(); ++z)
                    for (int y = 0; y < n.y(); ++y)
                        for (int x = 0; x < n.x(); ++x)
                            sum += (double(values[i++]) - mean) *
                                   std::polar(1.0, -2 * pi *
                                                       (double(kx) * x / n.x() + double(ky) * y / n.y() +
                                                        double(kz) * z / n.z()));
                const Vec3d f((2 * kx > n.x() ? kx - n.x() : kx) / (n.x() * voxel.x()),
                              (2 * ky > n.y() ? ky - n.y() : ky) / (n.y() * voxel.y()),
                              (2 * kz > n.z() ? kz - n.z() : kz) / (n.z() * voxel.z()));
                auto& [power, count] = shells[std::lround(f.norm() / width)];
                power += std::norm(sum) / static_cast<double>(values.size());
                ++count;
            }
    return shells;
}

PowerSpectrumOptions plain() {
    PowerSpectrumOptions options;
    options.taper = 0;
    return options;
}

void expect_direct(const Vec3i& n, const Vec3d& voxel) {
    const auto values = noise(static_cast<std::size_t>(n.prod()), 7);
    Frame frame;
    frame.axes = voxel.asDiagonal();
    const PowerSpectrum s = power_spectrum(map_from_values(n, values, frame), plain());
    double width = std::numeric_limits<double>::infinity(), nyquist = width;
    for (int a = 0; a < 3; ++a) {
        if (n[a] < 2) continue;
        width = std::min(width, 1 / (n[a] * voxel[a]));
        nyquist = std::min(nyquist, 0.5 / voxel[a]);
    }
    const auto expected = direct(n, values, voxel, width);
    ASSERT_FALSE(s.frequency.empty());
    EXPECT_LE(s.frequency.back(), nyquist * (1 + 1e-9));
    EXPECT_GT(s.frequency.back(), nyquist - 1.001 * width);
    for (std::size_t i = 0; i < s.frequency.size(); ++i) {
        const auto& [power, count] = expected.at(std::lround(s.frequency[i] / width));
        EXPECT_EQ(s.count[i], static_cast<std::uint64_t>(count));
        EXPECT_NEAR(s.power[i], power / count, 1e-5 * power / count) << s.frequency[i];
    }
}

}  // namespace

TEST(PowerSpectrum, IsTheShellMeanOfTheTransform) {
    expect_direct({12, 10, 8}, {1, 1, 1});
    expect_direct({9, 5, 15}, {1, 1, 1});  // odd: no Nyquist column
    expect_direct({8, 8, 8}, {1.5, 2, 3});
    expect_direct({16, 12, 1}, {2, 2, 2});  // a picture
    expect_direct({1, 9, 10}, {2, 2, 2});
}

TEST(PowerSpectrum, OfWhiteNoiseIsItsVariance) {
    const PowerSpectrum s =
        power_spectrum(map_from_values({48, 48, 48}, noise(48 * 48 * 48, 3), centred_frame(48, 2)));
    ASSERT_EQ(s.frequency.size(), 24u);
    EXPECT_DOUBLE_EQ(s.frequency.back(), 0.25);
    for (std::size_t i = 6; i < s.power.size(); ++i) EXPECT_NEAR(s.power[i], 1.0 / 3, 0.05) << i;
}

TEST(PowerSpectrum, AWaveStandsInItsShell) {
    const Frame frame = centred_frame(60, 1.25);
    const double f = 9 / (60 * 1.25);
    const PowerSpectrum s = power_spectrum(map_from_function({60, 60, 60}, frame, [&](const Vec3d& p) {
        return 100 + std::cos(2 * pi * f * (0.6 * p.x() + 0.8 * p.y()));
    }));
    const auto most = std::max_element(s.power.begin(), s.power.end()) - s.power.begin();
    EXPECT_NEAR(s.frequency[static_cast<std::size_t>(most)], f, 1e-9);
    EXPECT_LT(s.power.back(), 1e-6 * s.power[static_cast<std::size_t>(most)]);  // the constant is taken away
}

TEST(PowerSpectrum, TakesTheMiddleOfALargeMap) {
    // Noise only in the middle box, which begins at (30 − 16) / 2.
    const auto random = noise(16 * 16 * 16, 5);
    std::vector<float> values(30 * 30 * 30, 0.0f);
    for (int z = 0; z < 16; ++z)
        for (int y = 0; y < 16; ++y)
            for (int x = 0; x < 16; ++x)
                values[static_cast<std::size_t>((z + 7) * 900 + (y + 7) * 30 + x + 7)] =
                    random[static_cast<std::size_t>((z * 16 + y) * 16 + x)];
    PowerSpectrumOptions options = plain();
    options.largest = 17;  // 16 is the next product of 2, 3, 5
    const PowerSpectrum cut = power_spectrum(map_from_values({30, 30, 30}, values), options);
    EXPECT_EQ(cut.power, power_spectrum(map_from_values({16, 16, 16}, random), plain()).power);
}

TEST(PowerSpectrum, IsTheSameForAnyNumberOfThreads) {
    const DensityMap map = map_from_values({40, 30, 36}, noise(40 * 30 * 36, 11));
    const PowerSpectrum many = power_spectrum(map);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(power_spectrum(map).power, many.power);
}

TEST(PowerSpectrum, EmptyConstantAndDamagedMaps) {
    DensityMap empty;
    empty.grid = openvdb::FloatGrid::create();
    EXPECT_TRUE(power_spectrum(empty).power.empty());
    EXPECT_TRUE(power_spectrum(map_from_values({1, 1, 1}, {2})).power.empty());
    for (const double p : power_spectrum(map_from_values({8, 8, 8}, std::vector<float>(512, 3.5f))).power)
        EXPECT_NEAR(p, 0, 1e-10);
    std::vector<float> values = noise(512, 1);
    values[100] = std::numeric_limits<float>::quiet_NaN();
    for (const double p : power_spectrum(map_from_values({8, 8, 8}, values)).power)
        EXPECT_TRUE(std::isfinite(p) && p > 0);
}

TEST(PowerSpectrum, RefusesOptionsOutOfRange) {
    PowerSpectrumOptions options;
    options.largest = 1;
    EXPECT_THROW(options.check(), InvalidInput);
    options = {};
    options.taper = 0.6;
    EXPECT_THROW(options.check(), InvalidInput);
    const DensityMap map = map_from_values({8, 8, 8}, noise(512, 1));
    EXPECT_THROW(power_spectrum(map, {}, Progress([](double) { return false; })), Cancelled);
}

}  // namespace vdbgeo
