#include "vdbgeo/measure/isovalue_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/volume/enclosing_level.h"

using namespace vdbgeo;
using openvdb::Coord;

namespace {

DensityMap make_map(int n, const std::function<double(const Coord&)>& value, double voxel = 2) {
    DensityMap map;
    map.grid = test::box_grid(test::box_of(Coord(0, 0, 0), n, n, n), value);
    map.frame.size = Vec3i(n, n, n);
    map.frame.axes *= voxel;
    return map;
}

/// Two blobs that are 1 at their centres and fall off linearly: spheres at every level.
double blobs(const Coord& c) {
    const double a = (c.asVec3d() - openvdb::Vec3d(15.13, 15.31, 15.07)).length(),
                 b = (c.asVec3d() - openvdb::Vec3d(44.21, 44.02, 44.37)).length();
    return 1 - std::min(a, b) / 40;
}

}  // namespace

TEST(IsovalueTable, RowsRunFromHighToLowInEqualRatios) {
    const DensityMap map = make_map(60, blobs);
    IsovalueTableOptions options;
    options.rows = 9;
    const std::vector<IsovalueRow> rows = isovalue_table(map, options);
    ASSERT_EQ(rows.size(), 9u);
    EXPECT_NEAR(rows.back().volume_A3, 0.1 * 216000 * 8, 0.02 * 216000 * 0.8);
    const double ratio = std::pow(0.1 * 216000 / 8, 1.0 / 8);
    for (std::size_t k = 0; k < rows.size(); ++k) {
        EXPECT_EQ(rows[k].volume_A3, 8.0 * static_cast<double>(voxels_above(map, {rows[k].isovalue})[0]));
        EXPECT_EQ(rows[k].components, 2u) << k;
        if (k == 0) continue;
        EXPECT_LT(rows[k].isovalue, rows[k - 1].isovalue);
        EXPECT_NEAR(rows[k].volume_A3 / rows[k - 1].volume_A3, ratio, k > 3 ? 0.02 * ratio : 0.1 * ratio);
        // two spheres of the volume told
        const double r = std::cbrt(rows[k].volume_A3 / 2 * 3 / (4 * M_PI));
        EXPECT_NEAR(rows[k].area_A2, 2 * 4 * M_PI * r * r, (k > 4 ? 0.03 : 0.6) * rows[k].area_A2);
    }
}

TEST(IsovalueTable, AreaAndPiecesAreThoseOfTheMesh) {
    std::mt19937 random(1);
    const DensityMap map =
        make_map(24, [&](const Coord&) { return static_cast<double>(random()) * 0x1p-32; });
    for (const IsovalueRow& row : isovalue_table(map)) {
        const MeshMeasures measures = measure_mesh(marching_cubes(map, {row.isovalue}));
        EXPECT_NEAR(row.area_A2, measures.area_A2, 1e-9 * row.area_A2);
        EXPECT_EQ(row.components, measures.components);
    }
}

TEST(IsovalueTable, TheGivenIsovalueHasARow) {
    const DensityMap map = make_map(60, blobs);
    IsovalueTableOptions options;
    options.rows = 4;
    for (const double isovalue : {0.9, 0.5, 5.0, -5.0}) {
        options.isovalue = isovalue;
        const auto rows = isovalue_table(map, options);
        ASSERT_EQ(rows.size(), 5u);
        const auto row =
            std::find_if(rows.begin(), rows.end(), [&](const auto& r) { return r.isovalue == isovalue; });
        ASSERT_NE(row, rows.end());
        EXPECT_EQ(row->volume_A3, 8.0 * static_cast<double>(voxels_above(map, {isovalue})[0]));
        EXPECT_EQ(row->components == 0, std::abs(isovalue) == 5);
        EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end(),
                                   [](const auto& a, const auto& b) { return a.isovalue > b.isovalue; }));
    }
    // One that is a row anyway is given once.
    options.isovalue = isovalue_table(map, {4, {}, 0.1, 20'000'000})[2].isovalue;
    EXPECT_EQ(isovalue_table(map, options).size(), 4u);
}

TEST(IsovalueTable, RowsOfTooManyTrianglesAreLeftOutButTheGivenOneStays) {
    std::mt19937 random(1);
    const DensityMap map =
        make_map(40, [&](const Coord&) { return static_cast<double>(random()) * 0x1p-32; });
    IsovalueTableOptions options;
    const std::size_t all = isovalue_table(map, options).size();
    options.max_triangles = 5000;
    const auto fewer = isovalue_table(map, options);
    EXPECT_LT(fewer.size(), all);
    EXPECT_GT(fewer.size(), 0u);
    for (const IsovalueRow& row : fewer)
        EXPECT_LT(marching_cubes(map, {row.isovalue}).triangles.size(), 7000u);
    options.isovalue = 0.9;
    EXPECT_EQ(isovalue_table(map, options).size(), fewer.size() + 1);
}

TEST(IsovalueTable, SparseAndBoxlessMapsStayAboveTheirBackground) {
    for (const bool bounded : {true, false}) {
        DensityMap map;
        map.grid = openvdb::FloatGrid::create(0.0f);
        for (auto c = test::box_of(Coord(20, 20, 20), 16, 16, 16).begin(); c; ++c)
            map.grid->tree().setValueOn(
                *c, 1 + static_cast<float>((*c).x() * 256 + (*c).y() * 16 + (*c).z()) * 1e-4f);
        if (bounded) map.frame.size = Vec3i(60, 60, 60);
        const auto rows = isovalue_table(map);
        ASSERT_GT(rows.size(), 3u);
        for (const IsovalueRow& row : rows) {
            EXPECT_GT(row.isovalue, 1);
            EXPECT_EQ(row.components, 1u);
        }
    }
}

TEST(IsovalueTable, BytesGiveEachLevelOnce) {
    const DensityMap map = make_map(20, [](const Coord& c) { return c.x() / 7; });
    const auto rows = isovalue_table(map);
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows[0].isovalue, 1.5);
    EXPECT_EQ(rows[0].volume_A3, 8.0 * 6 * 400);
}

TEST(IsovalueTable, RefusesWhatHasNoTable) {
    const DensityMap flat = make_map(5, [](const Coord&) { return 1.0; });
    EXPECT_THROW(isovalue_table(flat), InvalidInput);
    DensityMap level_set = make_map(20, blobs);
    level_set.grid->setGridClass(openvdb::GRID_LEVEL_SET);
    EXPECT_THROW(isovalue_table(level_set), InvalidInput);
    const DensityMap map = make_map(20, blobs);
    for (const auto& change : std::vector<std::function<void(IsovalueTableOptions&)>>{
             [](auto& o) { o.rows = 1; }, [](auto& o) { o.rows = 1001; }, [](auto& o) { o.isovalue = NAN; },
             [](auto& o) { o.largest_share = 0; }, [](auto& o) { o.largest_share = 1.5; }}) {
        IsovalueTableOptions options;
        change(options);
        EXPECT_THROW(isovalue_table(map, options), InvalidInput);
    }
    EXPECT_THROW(isovalue_table(map, {}, Progress([](double) { return false; })), Cancelled);
}

TEST(IsovalueTable, IsTheSameForAnyNumberOfThreads) {
    std::mt19937 random(1);
    const DensityMap map =
        make_map(50, [&](const Coord&) { return static_cast<double>(random()) * 0x1p-32; });
    std::vector<IsovalueRow> one, four;
    test::with_threads(1, [&] { one = isovalue_table(map); });
    test::with_threads(4, [&] { four = isovalue_table(map); });
    ASSERT_EQ(one.size(), four.size());
    for (std::size_t k = 0; k < one.size(); ++k) {
        EXPECT_EQ(one[k].isovalue, four[k].isovalue);
        EXPECT_EQ(one[k].area_A2, four[k].area_A2);
        EXPECT_EQ(one[k].components, four[k].components);
    }
}
