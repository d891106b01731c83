#include "vdbgeo/volume/map_statistics.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>

#include "tests/support/maps.h"

namespace vdbgeo {
namespace {

using test::map_from_values;
using test::noise;

/// Sample by sample, through the accessor.
Statistics one_by_one(const DensityMap& map) {
    Statistics s;
    std::vector<double> values;
    for (int z = 0; z < map.frame.size.z(); ++z)
        for (int y = 0; y < map.frame.size.y(); ++y)
            for (int x = 0; x < map.frame.size.x(); ++x)
                values.push_back(double(map.grid->tree().getValue(openvdb::Coord(x, y, z))));
    for (const double v : values) {
        ++s.count;
        s.non_finite += !std::isfinite(v);
        if (!std::isfinite(v)) continue;
        s.min = std::min(s.min, v);
        s.max = std::max(s.max, v);
        s.mean += v;
    }
    s.mean /= static_cast<double>(s.count - s.non_finite);
    for (const double v : values)
        if (std::isfinite(v)) s.rms += (v - s.mean) * (v - s.mean);
    s.rms = std::sqrt(s.rms / static_cast<double>(s.count - s.non_finite));
    return s;
}

void expect_same(const Statistics& a, const Statistics& b) {
    EXPECT_EQ(a.count, b.count);
    EXPECT_EQ(a.non_finite, b.non_finite);
    EXPECT_EQ(a.min, b.min);
    EXPECT_EQ(a.max, b.max);
    EXPECT_NEAR(a.mean, b.mean, 1e-12 * (1 + std::abs(b.mean)));
    EXPECT_NEAR(a.rms, b.rms, 1e-9 * b.rms + 1e-12);
}

/// A constant block (a tile), noise with a large mean, a border that ends inside leaves.
std::vector<float> mixed(const Vec3i& n) {
    std::vector<float> values = noise(static_cast<std::size_t>(n.prod()), 9);
    for (int z = 0; z < n.z(); ++z)
        for (int y = 0; y < n.y(); ++y)
            for (int x = 0; x < n.x(); ++x) {
                float& v = values[static_cast<std::size_t>((z * n.y() + y) * n.x() + x)];
                v = x < 8 && y < 8 && z < 8 ? 1001.5f : v + 1000;
            }
    return values;
}

}  // namespace

TEST(MapStatistics, AreThoseOfEverySampleInTheBox) {
    const Vec3i n(19, 13, 21);
    SparsifyOptions some;
    some.threshold = 1000.8f;
    SparsifyOptions band = some;
    band.band = 0.1f;
    for (const SparsifyOptions& options : {SparsifyOptions(), some, band}) {
        const DensityMap map = map_from_values(n, mixed(n), {}, options);
        const Statistics s = statistics_of(map);
        expect_same(s, one_by_one(map));
        EXPECT_EQ(s.count, 19u * 13 * 21);
        const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
        EXPECT_EQ(statistics_of(map).rms, s.rms);
    }
    auto values = mixed(n);
    values[77] = std::numeric_limits<float>::quiet_NaN();
    const DensityMap damaged = map_from_values(n, values);
    expect_same(statistics_of(damaged), one_by_one(damaged));
}

TEST(MapStatistics, WithoutABoxThoseOfTheActiveVoxels) {
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(5);
    EXPECT_EQ(statistics_of(map).count, 0u);
    map.grid->tree().setValue(openvdb::Coord(-3, 2, 900), 1);
    map.grid->tree().setValue(openvdb::Coord(3, 2, 900), 4);
    const Statistics s = statistics_of(map);
    EXPECT_EQ(s.count, 2u);
    EXPECT_EQ(s.mean, 2.5);
    EXPECT_EQ(s.rms, 1.5);
}

TEST(MapStatistics, DifferenceOfGridsWithTiles) {
    const Vec3i n(19, 13, 21);
    const DensityMap a = map_from_values(n, mixed(n));
    const auto b = a.grid->deepCopy();
    EXPECT_EQ(rms_difference(*a.grid, *b), 0);
    b->tree().voxelizeActiveTiles();
    for (auto it = b->beginValueOn(); it; ++it) it.setValue(*it - 2);
    EXPECT_DOUBLE_EQ(rms_difference(*a.grid, *b), 2);
    EXPECT_DOUBLE_EQ(rms_difference(*b, *a.grid), 2);
    EXPECT_NEAR(active_moments(*b).mean, active_moments(*a.grid).mean - 2, 1e-9);
    EXPECT_EQ(active_moments(*a.grid).count, 19u * 13 * 21);
}

}  // namespace vdbgeo
