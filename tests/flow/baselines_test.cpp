#include "vdbgeo/flow/baselines.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/dense_oracle.h"
#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using test::Oracle;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

void gaussian(openvdb::FloatGrid& grid) { gaussian_filter(grid, 1.3); }
void median(openvdb::FloatGrid& grid) { median_filter(grid, 2); }
void bilateral(openvdb::FloatGrid& grid) { bilateral_filter(grid, {1.2, 0.7}); }

using Filter = void (*)(openvdb::FloatGrid&);
constexpr Filter filters[] = {gaussian, median, bilateral};

class BaselinesOn : public testing::TestWithParam<std::string> {};

TEST_P(BaselinesOn, AgreeWithTheOracle) {
    const auto input = test::sparse_grid(GetParam(), 21);
    const Oracle oracle(*input);
    for (const double sigma : {0.2, 0.5, 1.0, 2.4}) {
        SCOPED_TRACE(sigma);
        const auto grid = input->deepCopy();
        gaussian_filter(*grid, sigma);
        EXPECT_LT(test::largest_difference(*grid, oracle, oracle.gaussian(sigma)), 2e-6);
        EXPECT_TRUE(test::inactive_untouched(*grid));
    }
    for (const int radius : {1, 2, 3}) {
        SCOPED_TRACE(radius);
        const auto grid = input->deepCopy();
        median_filter(*grid, radius);
        EXPECT_LT(test::largest_difference(*grid, oracle, oracle.median(radius)), 1e-7);
        EXPECT_TRUE(test::inactive_untouched(*grid));
    }
    for (const BilateralOptions& o : {BilateralOptions{1.5, 0.4}, {0.4, 1}, {2, 100}, {1, 0.01}}) {
        SCOPED_TRACE(o.sigma);
        const auto grid = input->deepCopy();
        bilateral_filter(*grid, o);
        EXPECT_LT(test::largest_difference(*grid, oracle, oracle.bilateral(o)), 2e-6);
        EXPECT_TRUE(test::inactive_untouched(*grid));
    }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
    std::string out = info.param;
    std::replace(out.begin(), out.end(), ' ', '_');
    return out;
}

INSTANTIATE_TEST_SUITE_P(Masks, BaselinesOn, testing::ValuesIn(test::sparse_kinds()), name_of);

TEST(Baselines, WidestWindows) {
    const auto input = test::box_grid(test::box_of(Coord(20, -3, 57), 20, 11, 14), [](const Coord& c) {
        return std::sin(c.x() * 12.9898 + c.y() * 78.233 + c.z() * 37.719);
    });
    const Oracle oracle(*input);
    const auto grid = input->deepCopy();
    median_filter(*grid, 8);
    EXPECT_LT(test::largest_difference(*grid, oracle, oracle.median(8)), 1e-7);
    const auto row = test::sparse_grid("row", 3);
    const Oracle of_row(*row);
    auto wide = row->deepCopy();
    gaussian_filter(*wide, 10.5);
    EXPECT_LT(test::largest_difference(*wide, of_row, of_row.gaussian(10.5)), 2e-6);
    wide = row->deepCopy();
    bilateral_filter(*wide, {10.5, 0.5});
    EXPECT_LT(test::largest_difference(*wide, of_row, of_row.bilateral({10.5, 0.5})), 2e-6);
}

TEST(Baselines, DenseTilesAreThereToo) {
    // One cell and more that are active everywhere, with their halos.
    const auto f = [](const Coord& c) { return std::sin(0.7 * c.x() + 0.3 * c.y() * c.y()) + 0.01 * c.z(); };
    const auto grid = test::box_grid({Coord(-9, -9, -9), Coord(45, 45, 75)}, f);
    gaussian_filter(*grid, 1.5);
    const auto accessor = grid->getConstAccessor();
    for (const Coord& c :
         {Coord(0, 0, 0), Coord(10, 31, 63), Coord(31, 5, 40), Coord(32, 16, 0), Coord(-9, -9, -9)}) {
        double sum = 0, norm = 0;
        for (int x = -5; x <= 5; ++x)
            for (int y = -5; y <= 5; ++y)
                for (int z = -5; z <= 5; ++z) {
                    if (!accessor.isValueOn(c.offsetBy(x, y, z))) continue;
                    const double g = std::exp(-(x * x + y * y + z * z) / 4.5);
                    sum += g * f(c.offsetBy(x, y, z));
                    norm += g;
                }
        EXPECT_NEAR(accessor.getValue(c), sum / norm, 2e-6);
    }
}

TEST(Baselines, KeepConstants) {
    for (const Filter filter : filters) {
        const auto grid = test::sparse_grid("cells", 2);
        for (auto it = grid->beginValueOn(); it; ++it) it.setValue(3.25f);
        filter(*grid);
        for (auto it = grid->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, 3.25f);
    }
}

TEST(Baselines, NeutralValuesGiveTheInputBack) {
    const auto input = test::sparse_grid("cells", 2), grid = input->deepCopy();
    gaussian_filter(*grid, 0);
    median_filter(*grid, 0);
    EXPECT_EQ(test::bits_of(*grid), test::bits_of(*input));
    gaussian_filter(*grid, 1e-200);
    EXPECT_LT(test::largest_difference(*grid, Oracle(*input), Oracle(*input).input()), 1e-6);
}

TEST(Baselines, ScaleWithTheValues) {
    const auto input = test::sparse_grid("few leaves", 6);
    for (const double scale : {1e-8, 1e8, -1.0}) {
        const auto scaled = input->deepCopy();
        for (auto it = scaled->beginValueOn(); it; ++it) it.setValue(static_cast<float>(*it * scale));
        const Oracle oracle(*scaled);
        const BilateralOptions options{1.2, 0.5 * std::abs(scale)};
        const auto a = scaled->deepCopy(), b = scaled->deepCopy(), c = scaled->deepCopy();
        gaussian_filter(*a, 1.1);
        median_filter(*b, 1);
        bilateral_filter(*c, options);
        const double tolerance = 2e-6 * std::abs(scale);
        EXPECT_LT(test::largest_difference(*a, oracle, oracle.gaussian(1.1)), tolerance);
        EXPECT_LT(test::largest_difference(*b, oracle, oracle.median(1)), tolerance);
        EXPECT_LT(test::largest_difference(*c, oracle, oracle.bilateral(options)), tolerance);
    }
}

TEST(Baselines, MedianOrdersTiesAndBothZeros) {
    const auto grid = test::box_grid(test::box_of(Coord(-4), 9, 9, 9), [](const Coord& c) {
        const int k = (c.x() * 5 + c.y() * 3 + c.z() + 100) % 4;
        return k == 0 ? -0.0 : k - 1.0;
    });
    const Oracle oracle(*grid);
    median_filter(*grid, 2);
    EXPECT_EQ(test::largest_difference(*grid, oracle, oracle.median(2)), 0);
}

TEST(Baselines, GiveTheSameBitsForAnyNumberOfThreads) {
    for (const Filter filter : filters) {
        const auto input = test::sparse_grid("shell", 8);
        std::vector<std::uint32_t> first;
        for (const std::size_t threads : {1, 2, 4})
            test::with_threads(threads, [&] {
                const auto grid = input->deepCopy();
                filter(*grid);
                if (threads == 1) first = test::bits_of(*grid);
                EXPECT_EQ(test::bits_of(*grid), first);
            });
    }
}

TEST(Baselines, MoveWithTheGrid) {
    for (const Filter filter : filters) {
        const auto here = test::box_grid(test::box_of(Coord(0), 12, 9, 10), [](const Coord& c) {
            return std::sin(c.x() * 12.9898 + c.y() * 78.233 + c.z() * 37.719);
        });
        const auto moved = test::empty_grid();
        for (auto it = here->cbeginValueOn(); it; ++it)
            moved->tree().setValueOn(it.getCoord().offsetBy(29, -5, 60), *it);
        filter(*here);
        filter(*moved);
        for (auto it = here->cbeginValueOn(); it; ++it)
            ASSERT_NEAR(moved->tree().getValue(it.getCoord().offsetBy(29, -5, 60)), *it, 5e-7);
    }
}

TEST(Baselines, TakeTilesAndNothing) {
    for (const Filter filter : filters) {
        const auto nothing = test::empty_grid();
        filter(*nothing);
        EXPECT_EQ(nothing->activeVoxelCount(), 0u);
        const auto tiles = test::empty_grid();
        tiles->tree().addTile(1, Coord(8), 2.0f, true);
        tiles->tree().setValueOn(Coord(7, 8, 8), 1.0f);
        const Oracle oracle(*tiles);
        filter(*tiles);
        EXPECT_EQ(tiles->activeVoxelCount(), 513u);
        EXPECT_EQ(tiles->tree().getValue(Coord(15, 15, 15)), 2.0f);
    }
}

TEST(Baselines, RefuseWhatIsNotFiniteAndTouchNothing) {
    for (const Filter filter : filters)
        for (const float odd : {nan, std::numeric_limits<float>::infinity()}) {
            const auto grid = test::sparse_grid("few leaves", 2);
            grid->tree().setValueOn(grid->cbeginValueOn().getCoord(), odd);
            const auto before = test::bits_of(*grid);
            EXPECT_THROW(filter(*grid), InvalidInput);
            EXPECT_EQ(test::bits_of(*grid), before);
        }
}

TEST(Baselines, RefuseBadOptions) {
    const auto grid = test::sparse_grid("one voxel", 2);
    for (const double sigma : {-1.0, 10.6, std::nan(""), std::numeric_limits<double>::infinity()})
        EXPECT_THROW(gaussian_filter(*grid, sigma), InvalidInput) << sigma;
    for (const int radius : {-1, 9}) EXPECT_THROW(median_filter(*grid, radius), InvalidInput) << radius;
    for (const BilateralOptions& o : {BilateralOptions{0, 1},
                                      {-1, 1},
                                      {11, 1},
                                      {std::nan(""), 1},
                                      {1, 0},
                                      {1, -1},
                                      {1, std::nan("")},
                                      {1, std::numeric_limits<double>::infinity()}})
        EXPECT_THROW(bilateral_filter(*grid, o), InvalidInput) << o.sigma << ", " << o.range;
}

TEST(Baselines, StopWhenTheyAreToldTo) {
    const Progress stop([](double) { return false; });
    const auto grid = test::sparse_grid("few leaves", 2);
    const auto before = test::bits_of(*grid);
    EXPECT_THROW(gaussian_filter(*grid, 1, stop), Cancelled);
    EXPECT_THROW(median_filter(*grid, 1, stop), Cancelled);
    EXPECT_THROW(bilateral_filter(*grid, {}, stop), Cancelled);
    EXPECT_EQ(test::bits_of(*grid), before);
}

}  // namespace
}  // namespace vdbgeo
