#include "vdbgeo/volume/density_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using openvdb::Coord;

namespace {

Frame box(const Mat3d& axes, const Vec3d& origin) {
    Frame frame;
    frame.axes = axes;
    frame.origin = origin;
    frame.size = Vec3i(5, 6, 7);
    return frame;
}

Mat3d diagonal(double x, double y, double z) { return Vec3d(x, y, z).asDiagonal(); }

DensityMap map_with(const Frame& frame) {
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(-1);
    map.grid->tree().setValue(Coord(1, 2, 3), 4);
    map.frame = frame;
    map.statistics = {210, 3, -1.5, 4.25, 0.1, 0.7};
    return map;
}

void expect_same(const Statistics& a, const Statistics& b) {
    EXPECT_EQ(a.count, b.count);
    EXPECT_EQ(a.non_finite, b.non_finite);
    EXPECT_EQ(a.min, b.min);
    EXPECT_EQ(a.max, b.max);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.rms, b.rms);
}

}  // namespace

TEST(DensityMap, TheFrameComesBackFromTheGridToTheLastBit) {
    Mat3d skewed;
    skewed << 1.1, -0.3, 0.2, 0, 0.9, 0.1, 0, 0, 1.3;
    const Mat3d turned = Eigen::AngleAxisd(0.4, Vec3d(1, 2, 3).normalized()).toRotationMatrix() * 2.7;
    const Vec3d far(-123456.789, 98765.4321, 0.1);
    for (const Mat3d& axes :
         {Mat3d(Mat3d::Identity()), diagonal(1.07, 1.07, 1.07), diagonal(14.5, 18.3, 17.3), skewed, turned,
          diagonal(1e-4, 1e-4, 1e-4), diagonal(1e-5, 2e-5, 3e-5), diagonal(1e6, 1e6, 1e6),
          diagonal(1e8, 2e8, 3e8), diagonal(1, 1 + 1e-12, 1), diagonal(-1.5, 1.5, 1.5)})
        for (const Vec3d& origin : {Vec3d(0, 0, 0), Vec3d(1, -2, 3.5), far}) {
            DensityMap map = map_with(box(axes, origin));
            store_frame(map);
            const DensityMap back = map_from_grid(map.grid);
            EXPECT_EQ(back.frame.axes, axes);
            EXPECT_EQ(back.frame.origin, origin);
            EXPECT_EQ(back.frame.size, map.frame.size);
            expect_same(back.statistics, map.statistics);
            const Vec3d world = map.frame.to_world(Vec3d(1, 2, 3));
            const auto theirs = map.grid->transform().indexToWorld(Coord(1, 2, 3));
            for (int a = 0; a < 3; ++a)
                EXPECT_NEAR(theirs[a], world[a], 1e-12 * (axes.norm() + origin.norm()));
        }
}

TEST(DensityMap, AnUnboundedFrameStaysUnbounded) {
    DensityMap map = map_with(box(Mat3d::Identity(), Vec3d::Zero()));
    store_frame(map);
    map.frame.size = Vec3i::Zero();
    store_frame(map);
    EXPECT_FALSE(map_from_grid(map.grid).frame.bounded());
}

TEST(DensityMap, AFrameThatATransformCannotHoldIsRefused) {
    Mat3d flat = Mat3d::Identity();
    flat.col(2) = flat.col(0) + flat.col(1);
    for (const Mat3d& axes :
         {diagonal(0, 1, 1), flat, Mat3d(Mat3d::Identity() * std::nan("")), diagonal(1e-5, 1e-5, 1e-5)}) {
        DensityMap map = map_with(box(axes, Vec3d::Zero()));
        EXPECT_THROW(store_frame(map), InvalidInput);
    }
}

TEST(DensityMap, AGridFromElsewhereGetsStatisticsOfItsActiveVoxels) {
    auto grid = openvdb::FloatGrid::create(7);
    grid->tree().addTile(1, Coord(0, 0, 0), 1e6f, true);  // 512 voxels
    grid->tree().addTile(2, Coord(128, 0, 0), 5, false);  // inactive: does not count
    for (int i = 0; i < 512; ++i) grid->tree().setValue(Coord(-1, 0, i), 1e6f + 2);
    grid->tree().setValue(Coord(-1, -1, 0), std::nanf(""));
    grid->setTransform(openvdb::math::Transform::createLinearTransform(2.5));
    const DensityMap map = map_from_grid(grid);
    EXPECT_FALSE(map.frame.bounded());
    EXPECT_EQ(map.frame.voxel_size(), Vec3d(2.5, 2.5, 2.5));
    EXPECT_EQ(map.statistics.count, 1025u);
    EXPECT_EQ(map.statistics.non_finite, 1u);
    EXPECT_EQ(map.statistics.min, 1e6);
    EXPECT_EQ(map.statistics.max, 1e6 + 2);
    EXPECT_NEAR(map.statistics.mean, 1e6 + 1, 1e-9);
    EXPECT_NEAR(map.statistics.rms, 1, 1e-9);
    EXPECT_EQ(map_from_grid(openvdb::FloatGrid::create()).statistics.count, 0u);
}

TEST(DensityMap, MetadataThatCannotBeAreNotTaken) {
    DensityMap map = map_with(box(Mat3d::Identity(), Vec3d::Zero()));
    store_frame(map);
    map.grid->insertMeta("vdbgeo_samples", openvdb::Int64Metadata(-5));
    EXPECT_EQ(map_from_grid(map.grid).statistics.count, 1u);
    map.grid->insertMeta("vdbgeo_size", openvdb::Vec3IMetadata(openvdb::Vec3i(5, 0, 5)));
    EXPECT_THROW(map_from_grid(map.grid), InvalidInput);
}

TEST(DensityMap, ATransformThatIsNotLinearIsRefused) {
    auto grid = openvdb::FloatGrid::create();
    grid->setTransform(openvdb::math::Transform::createFrustumTransform(
        openvdb::BBoxd(openvdb::Vec3d(0), openvdb::Vec3d(10)), 0.5, 10, 1));
    EXPECT_THROW(map_from_grid(grid), InvalidInput);
}

TEST(DensityMap, HistoryGrowsLineByLine) {
    auto grid = openvdb::FloatGrid::create();
    add_history(*grid, "read a.mrc");
    EXPECT_EQ(grid->metaValue<std::string>("vdbgeo_history"), "read a.mrc");
    add_history(*grid, "denoise --steps 3");
    EXPECT_EQ(grid->metaValue<std::string>("vdbgeo_history"), "read a.mrc\ndenoise --steps 3");
}
