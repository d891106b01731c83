#include "vdbgeo/tet/map_projection.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/surface/trilinear_field.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

/// Skewed and anisotropic.
Frame skewed() {
    Frame frame;
    frame.axes << 1.0, 0.3, 0.1, 0, 1.4, -0.2, 0, 0, 0.8;
    frame.origin = -frame.axes * Vec3d(20, 15, 24);
    return frame;
}

DensityMap cone_map(const Frame& frame) {
    return map_from_function({41, 31, 49}, frame, [](const Vec3d& p) { return 20 - p.norm(); });
}

}  // namespace

TEST(MapProjection, LandsOnTheInterpolantAndNearby) {
    Frame frame = skewed();
    const DensityMap map = cone_map(frame);
    const double isovalue = 20 - 11.3;
    const SurfaceProjection project = map_projection(map, isovalue);
    const TrilinearField field(map, isovalue);
    const Mat3d inverse = frame.axes.inverse();
    for (int i = 0; i < 500; ++i) {
        const double z = -0.95 + 1.9 * i / 499, angle = 2.4 * i, off = 0.5 * std::sin(7.0 * i);
        const Vec3d n(std::sqrt(1 - z * z) * std::cos(angle), std::sqrt(1 - z * z) * std::sin(angle), z);
        const Vec3d x = (11.3 + off) * n;
        const auto y = project(x);
        ASSERT_TRUE(y) << i;
        EXPECT_NEAR(field(inverse * (*y - frame.origin)), 0, 1e-9);
        EXPECT_NEAR((*y - x).norm(), std::abs(off), 0.05);  // straight along the normal, not along an axis
        EXPECT_LT((*y - 11.3 * n).norm(), 0.1);
        const auto again = project(*y);
        ASSERT_TRUE(again);
        EXPECT_LT((*again - *y).norm(), 1e-9);
    }
    EXPECT_FALSE(project(Vec3d(0, 0, 12.5)));  // more than the smallest voxel step away
    EXPECT_FALSE(project(Vec3d(0, 0, 9.9)));
    EXPECT_FALSE(project(Vec3d(std::nan(""), 0, 0)));
    EXPECT_FALSE(project(Vec3d(1e9, 0, 0)));
}

TEST(MapProjection, StaysOnTheBorderOfTheBox) {
    const Frame frame = centred_frame(21, 1.0);  // from −10 to 10: the ball of radius 12 is cut off
    const DensityMap map =
        map_from_function({21, 21, 21}, frame, [](const Vec3d& p) { return 20 - p.norm(); });
    const SurfaceProjection project = map_projection(map, 8);
    // On a wall: stays. Out of the box: back to the wall. A little inside: to the wall, the isosurface is
    // far.
    EXPECT_EQ(*project(Vec3d(2, 3, 10)), Vec3d(2, 3, 10));
    EXPECT_LT((*project(Vec3d(2, 3, 10.4)) - Vec3d(2, 3, 10)).norm(), 1e-12);
    EXPECT_LT((*project(Vec3d(-10 + 0.3, 1, 2)) - Vec3d(-10, 1, 2)).norm(), 1e-12);
    EXPECT_FALSE(project(Vec3d(2, 3, 11.1)));
    // On a wall but out of the isosurface: along the wall to where they meet.
    const auto rim = project(Vec3d(5, 4.8, 10));
    ASSERT_TRUE(rim);
    EXPECT_EQ(rim->z(), 10);
    EXPECT_NEAR(rim->norm(), 12, 0.02);
    EXPECT_NEAR(rim->x() / rim->y(), 5 / 4.8, 0.01);
    // Between the wall and the isosurface: the nearer one.
    const Vec3d n = Vec3d(1, 1, 1.4).normalized();
    EXPECT_NEAR(project(11.8 * n)->norm(), 12, 0.02);
}

TEST(MapProjection, WithoutABoxAndWithoutASurface) {
    DensityMap map = cone_map(centred_frame(3, 1.0));
    map.frame.size = Vec3i::Zero();
    EXPECT_TRUE(map_projection(map, 8)(map.frame.to_world(Vec3d(20, 15, 24)) + Vec3d(0, 0, 0)) ==
                std::nullopt);
    const DensityMap flat =
        map_from_function({9, 9, 9}, centred_frame(9, 1.0), [](const Vec3d&) { return 1.0; });
    EXPECT_FALSE(map_projection(flat, 0.5)(Vec3d(0.2, 0.1, 0.3)));
    EXPECT_FALSE(map_projection(flat, 2)(Vec3d(0.2, 0.1, 0.3)));
    EXPECT_THROW(map_projection(flat, std::nan("")), InvalidInput);
}
