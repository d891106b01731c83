#include "vdbgeo/flow/noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "tests/support/dense_oracle.h"
#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/baselines.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;

openvdb::FloatGrid::Ptr noisy(double sigma, const std::function<double(const Coord&)>& clean) {
    std::mt19937_64 random(1);
    // Box and Muller's: the same numbers with every library.
    const auto uniform = [&] { return (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53; };
    return test::box_grid(test::box_of(Coord(-13, 5, -40), 48, 40, 50), [&](const Coord& c) {
        const double r = std::sqrt(-2 * std::log(uniform()));
        return clean(c) + sigma * r * std::cos(6.283185307179586 * uniform());
    });
}

TEST(Noise, OfWhiteNoiseIsItsStandardDeviation) {
    for (const double sigma : {1e-8, 1e-3, 1.0, 250.0, 1e8})
        EXPECT_NEAR(estimate_noise(*noisy(sigma, [](const Coord&) { return 0.0; })) / sigma, 1, 0.01);
}

TEST(Noise, DoesNotSeeSmoothStructure) {
    const auto waves = [](const Coord& c) {
        return 20 * std::sin(0.15 * c.x()) * std::cos(0.1 * c.y()) + 0.5 * c.z();
    };
    EXPECT_NEAR(estimate_noise(*noisy(1, waves)), 1, 0.03);
    EXPECT_NEAR(
        estimate_noise(*noisy(
            1, [](const Coord& c) { return (c - Coord(10, 20, -15)).asVec3d().length() < 12 ? 30 : 0; })),
        1, 0.1);
}

TEST(Noise, AgreesWithTheOracleOnEveryMask) {
    for (const std::string& kind : test::sparse_kinds())
        for (std::uint64_t seed = 1; seed < 4; ++seed) {
            const auto grid = test::sparse_grid(kind, seed);
            const double expected = test::Oracle(*grid).noise();
            EXPECT_NEAR(estimate_noise(*grid), expected, 1e-6 * expected) << kind;
        }
}

TEST(Noise, IsZeroWhereNoVoxelHasAllNeighbours) {
    EXPECT_EQ(estimate_noise(*test::empty_grid()), 0);
    EXPECT_EQ(estimate_noise(*test::sparse_grid("one voxel", 1)), 0);
    EXPECT_EQ(estimate_noise(*test::sparse_grid("row", 1)), 0);
    EXPECT_EQ(
        estimate_noise(*test::box_grid(test::box_of(Coord(0), 9, 9, 9), [](const Coord&) { return 5; })), 0);
}

TEST(Noise, OfNeighboursThatShareItIsSeenAtADistance) {
    const auto grid = noisy(2, [](const Coord&) { return 0.0; });
    for (const int spacing : {1, 2, 4}) EXPECT_NEAR(estimate_noise(*grid, spacing), 2, 0.06);
    EXPECT_EQ(removable_noise(*grid), estimate_noise(*grid, 2));
    gaussian_filter(*grid, 0.6);
    EXPECT_GT(estimate_noise(*grid, 2), 1.5 * estimate_noise(*grid, 1));
    EXPECT_EQ(removable_noise(*grid), estimate_noise(*grid, 2));
    // A smooth density is no noise, however much it varies.
    const auto wave = noisy(0.001, [](const Coord& c) { return std::sin(0.1 * c.x()); });
    EXPECT_EQ(removable_noise(*wave), estimate_noise(*wave, 1));
    EXPECT_THROW(estimate_noise(*grid, 0), InvalidInput);
    EXPECT_THROW(estimate_noise(*grid, 9), InvalidInput);
}

TEST(Noise, LeavesOutWhatIsConstant) {
    const auto half = noisy(1, [](const Coord&) { return 0.0; });
    const double all = estimate_noise(*half);
    for (auto it = half->beginValueOn(); it; ++it)
        if (it.getCoord().x() > 8) it.setValue(3);
    EXPECT_NEAR(estimate_noise(*half), all, 0.1);
}

TEST(Noise, CountsTheVoxelsOfActiveTiles) {
    auto tiles = test::empty_grid();
    tiles->tree().addTile(1, Coord(8, 8, 8), 2.0f, true);
    auto accessor = tiles->getAccessor();
    for (auto c = test::box_of(Coord(0, 8, 8), 8, 8, 8).begin(); c; ++c)
        accessor.setValueOn(*c, static_cast<float>(((*c).x() * 7 + (*c).y() * 3 + (*c).z() * 5) % 11));
    ASSERT_TRUE(tiles->tree().hasActiveTiles());
    const double expected = test::Oracle(*tiles).noise();
    EXPECT_GT(expected, 0);
    EXPECT_NEAR(estimate_noise(*tiles), expected, 1e-6 * expected);
    EXPECT_TRUE(tiles->tree().hasActiveTiles());
}

TEST(Noise, LeavesOutWhatIsNotFinite) {
    auto grid = noisy(1, [](const Coord&) { return 0.0; });
    grid->tree().setValueOn(Coord(0, 20, -20), std::numeric_limits<float>::quiet_NaN());
    grid->tree().setValueOn(Coord(5, 20, -20), std::numeric_limits<float>::infinity());
    EXPECT_NEAR(estimate_noise(*grid), 1, 0.01);
}

TEST(Noise, IsTheSameForAnyNumberOfThreads) {
    const auto grid = test::sparse_grid("shell", 7);
    double first = 0;
    test::with_threads(1, [&] { first = estimate_noise(*grid); });
    test::with_threads(4, [&] { EXPECT_EQ(estimate_noise(*grid), first); });
}

}  // namespace
}  // namespace vdbgeo
