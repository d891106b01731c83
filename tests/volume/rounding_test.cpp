#include "vdbgeo/volume/rounding.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;

constexpr float inf = std::numeric_limits<float>::infinity();

float float_of(std::uint32_t bits) {
    float v;
    std::memcpy(&v, &bits, sizeof v);
    return v;
}

std::uint32_t bits_of(float v) {
    std::uint32_t bits;
    std::memcpy(&bits, &v, sizeof bits);
    return bits;
}

/// Bit patterns from all over the range of floats: about seven million, all ties of halves among them.
template <class Visit>
void sweep(const Visit& visit) {
    for (std::uint64_t bits = 0; bits < 0x100000000; bits += 997)
        visit(float_of(static_cast<std::uint32_t>(bits)));
    for (std::uint64_t bits = 0; bits < 0x100000000; bits += 0x1000)
        for (const int off : {-1, 0, 1})
            visit(float_of(static_cast<std::uint32_t>(bits) + static_cast<std::uint32_t>(off)));
}

TEST(Half, AsOpenVdbStoresIt) {
    std::size_t wrong = 0;
    sweep([&](float v) {
        const float expected = static_cast<float>(openvdb::math::half(v)), got = rounded_to_half(v);
        if (std::isnan(v) ? !std::isnan(got) : bits_of(expected) != bits_of(got)) {
            if (++wrong < 10) ADD_FAILURE() << v << ": " << got << " and not " << expected;
        }
    });
    EXPECT_EQ(wrong, 0u);
}

TEST(Half, ErrorIsBounded) {
    double relative = 0, small = 0;
    sweep([&](float v) {
        if (!(std::fabs(v) < 65520)) return;
        const double error = std::fabs(static_cast<double>(rounded_to_half(v)) - static_cast<double>(v));
        if (std::fabs(v) >= 0x1p-14f)
            relative = std::max(relative, error / std::fabs(static_cast<double>(v)));
        else
            small = std::max(small, error);
    });
    EXPECT_LE(relative, 0x1p-11);
    EXPECT_GT(relative, 0.99 * 0x1p-11);
    EXPECT_LE(small, 0x1p-25);
    EXPECT_GT(small, 0.99 * 0x1p-25);
}

/// Noise over a few leaves, some of whose voxels are inactive, and a tile.
openvdb::FloatGrid::Ptr noisy_grid(float scale) {
    auto grid = openvdb::FloatGrid::create(0);
    const std::vector<float> values = test::noise(20 * 20 * 20, 4);
    std::size_t i = 0;
    for (auto c = openvdb::CoordBBox(Coord(-9), Coord(10)).begin(); c; ++c, ++i) {
        if (values[i] > -0.5f)
            grid->tree().setValueOn(*c, values[i] * scale);
        else
            grid->tree().setValueOff(*c, values[i] * scale);
    }
    grid->tree().addTile(1, Coord(800, 0, 0), 0.7f * scale, true);
    return grid;
}

/// What rounding the active values by f costs, value by value.
template <class Round>
RoundingError plain_error(const openvdb::FloatGrid& grid, const Round& round) {
    RoundingError e;
    for (auto v = grid.cbeginValueOn(); v; ++v) {
        const double value = static_cast<double>(*v),
                     error = std::fabs(static_cast<double>(round(*v)) - value);
        if (error > e.largest || (error == e.largest && error > 0 && v.getCoord() < e.at)) {
            e.largest = error;
            e.at = v.getCoord();
            e.value = *v;
        }
        if (value != 0) e.largest_relative = std::max(e.largest_relative, error / std::fabs(value));
    }
    return e;
}

void expect_same(const RoundingError& a, const RoundingError& b) {
    EXPECT_EQ(a.largest, b.largest);
    EXPECT_NEAR(a.largest_relative, b.largest_relative, 1e-6 * b.largest_relative);
    EXPECT_EQ(a.at, b.at);
    EXPECT_EQ(a.value, b.value);
}

TEST(Half, ErrorOfAGrid) {
    for (const float scale : {1e-7f, 1e-4f, 1.0f, 5e4f}) {
        const auto grid = noisy_grid(scale);
        const RoundingError error = half_rounding_error(*grid);
        EXPECT_GT(error.largest, 0);
        expect_same(error, plain_error(*grid, rounded_to_half));
        RoundingError joined;  // leaf by leaf, from the last
        std::vector<openvdb::FloatTree::LeafNodeType*> leaves;
        grid->tree().getNodes(leaves);
        for (auto leaf = leaves.rbegin(); leaf != leaves.rend(); ++leaf)
            joined.join(half_rounding_error(**leaf));
        grid->tree().addTile(1, Coord(800, 0, 0), 0, false);
        expect_same(joined, half_rounding_error(*grid));
        EXPECT_NO_THROW(check_half_range(*grid));
    }
}

TEST(Half, WhatIsExactCostsNothing) {
    auto grid = openvdb::FloatGrid::create(0);
    for (int i = -2048; i <= 2048; ++i) grid->tree().setValueOn(Coord(i, 0, 0), static_cast<float>(i));
    grid->tree().setValueOn(Coord(0, 100, 0), inf);
    grid->tree().setValueOn(Coord(0, 101, 0), std::numeric_limits<float>::quiet_NaN());
    grid->tree().setValueOn(Coord(0, 102, 0), -65504.0f);
    const RoundingError error = half_rounding_error(*grid);
    EXPECT_EQ(error.largest, 0);
    EXPECT_EQ(error.largest_relative, 0);
    EXPECT_NO_THROW(check_half_range(error));
    EXPECT_EQ(half_rounding_error(*openvdb::FloatGrid::create(1e30f)).largest, 0);
}

TEST(Half, TooLargeIsNamed) {
    const auto message = [](const openvdb::FloatGrid& grid) -> std::string {
        try {
            check_half_range(grid);
        } catch (const InvalidInput& error) {
            return error.what();
        }
        return "";
    };
    auto grid = openvdb::FloatGrid::create(0);
    grid->tree().setValueOn(Coord(9, 2, 3), 65519.0f);
    EXPECT_EQ(message(*grid), "");
    grid->tree().setValueOn(Coord(9, 2, 4), 65520.0f);
    grid->tree().setValueOn(Coord(-1, 2, 4), -1e30f);
    EXPECT_EQ(message(*grid),
              "the value -1e+30 of voxel (-1, 2, 4) does not fit into 16 bits: expected at most 65504 in "
              "magnitude");
    grid->tree().setValueOff(Coord(-1, 2, 4));
    EXPECT_NE(message(*grid).find("65520 of voxel (9, 2, 4)"), std::string::npos) << message(*grid);
    grid->clear();
    grid->tree().addTile(2, Coord(128, 0, 0), 7e4f, true);
    EXPECT_NE(message(*grid).find("70000 of voxel (128, 0, 0)"), std::string::npos) << message(*grid);
}

TEST(Quantise, StepIsAPowerOfTwo) {
    EXPECT_EQ(quantisation_step(1), 1);
    EXPECT_EQ(quantisation_step(0.99999999999), 0.5);
    EXPECT_EQ(quantisation_step(3), 2);
    EXPECT_EQ(quantisation_step(0.1), 0.0625);
    EXPECT_EQ(quantisation_step(0x1p-126), 0x1p-126f);
    EXPECT_EQ(quantisation_step(0x1.ffp103), 0x1p103f);
    for (const double bad : {0.0, -1.0, 1e-39, 1e32, static_cast<double>(inf), std::nan("")})
        EXPECT_THROW(quantisation_step(bad), InvalidInput) << bad;
    auto grid = noisy_grid(1);
    for (const float bad : {0.0f, -0.5f, 0.3f, 1e-40f, 0x1p104f, inf, std::nanf("")})
        EXPECT_THROW(quantise(*grid, bad), InvalidInput) << bad;
}

TEST(Quantise, NearestMultiple) {
    for (const float step : {0x1p-126f, 0x1p-30f, 0.25f, 1.0f, 64.0f, 0x1p103f}) {
        std::size_t wrong = 0;
        const auto fail = [&](float v, float got) {
            if (++wrong < 10) ADD_FAILURE() << v << " by " << step << ": " << got;
        };
        sweep([&](float v) {
            const float got = quantise(v, step);
            if (std::isnan(v)) return void(std::isnan(got) || (fail(v, got), true));
            const double value = static_cast<double>(v), s = static_cast<double>(step);
            // Beyond 2^23 steps it is a multiple already, and infinity stays.
            const double expected = std::fabs(value) < s * 0x1p23 ? s * std::nearbyint(value / s) : value;
            if (static_cast<double>(got) != expected || (got == 0 && std::signbit(got))) fail(v, got);
            if (std::isfinite(v) && std::fabs(static_cast<double>(got) - value) > s / 2) fail(v, got);
            if (bits_of(quantise(got, step)) != bits_of(got)) fail(v, got);
        });
        EXPECT_EQ(wrong, 0u);
    }
}

TEST(Quantise, AGrid) {
    for (const float step : {0x1p-4f, 0x1p-12f}) {
        auto grid = noisy_grid(1);
        const auto before = grid->deepCopy();
        const RoundingError error = quantise(*grid, step);
        expect_same(error, plain_error(*before, [&](float v) { return quantise(v, step); }));
        EXPECT_GT(error.largest, 0.4 * static_cast<double>(step));
        EXPECT_LE(error.largest, 0.5 * static_cast<double>(step));
        for (auto v = before->cbeginValueAll(); v; ++v) {
            const float expected = v.isValueOn() ? quantise(*v, step) : *v;
            ASSERT_EQ(grid->tree().getValue(v.getCoord()), expected) << v.getCoord();
        }
        EXPECT_EQ(grid->activeVoxelCount(), before->activeVoxelCount());
        const RoundingError again = quantise(*grid, step);
        EXPECT_EQ(again.largest, 0);
        EXPECT_EQ(again.largest_relative, 0);
    }
}

TEST(Rounding, JoinDoesNotDependOnTheOrder) {
    const RoundingError none, a{1, 0.5, Coord(3, 0, 0), 7}, b{1, 0.75, Coord(2, 9, 0), 8},
        c{0.5, 1, Coord(0, 0, 0), 9};
    const std::vector<std::vector<RoundingError>> orders{{none, a, b, c}, {c, b, a, none}, {b, none, c, a}};
    for (const auto& order : orders) {
        RoundingError e;
        for (const RoundingError& one : order) e.join(one);
        expect_same(e, {1, 1, Coord(2, 9, 0), 8});
    }
}

TEST(Rounding, AnyNumberOfThreads) {
    for (const std::size_t threads : {1, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        auto grid = noisy_grid(3);
        expect_same(half_rounding_error(*grid), plain_error(*grid, rounded_to_half));
        const auto before = grid->deepCopy();
        expect_same(quantise(*grid, 0.125f),
                    plain_error(*before, [](float v) { return quantise(v, 0.125f); }));
    }
}

}  // namespace
}  // namespace vdbgeo
