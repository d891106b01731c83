#include "vdbgeo/volume/derivatives.h"

#include <gtest/gtest.h>

#include "tests/support/maps.h"

namespace vdbgeo {
namespace {

using test::centred_frame;
using test::map_from_function;

/// A turned, skewed and anisotropic frame.
Frame skewed_frame(const Vec3i& size) {
    Frame frame;
    frame.axes << 1.0, 0.3, 0.1, 0.2, 1.4, -0.2, 0.0, 0.1, 0.8;
    frame.origin = Vec3d(31, -7, 12);
    frame.size = size;
    return frame;
}

TEST(Derivatives, GradientOfALinearFieldIsExactInAnyFrame) {
    const Vec3d slope(2, -0.5, 0.25);
    const Vec3i size(12, 11, 10);
    const DensityMap map =
        map_from_function(size, skewed_frame(size), [&](const Vec3d& p) { return slope.dot(p); });
    const auto grid = gradient(map);
    EXPECT_EQ(grid->getName(), "gradient");
    EXPECT_EQ(grid->getVectorType(), openvdb::VEC_COVARIANT);
    EXPECT_EQ(grid->activeVoxelCount(), map.grid->activeVoxelCount());
    for (int x = 1; x < 11; ++x)
        for (int y = 1; y < 10; ++y)
            for (int z = 1; z < 9; ++z) {
                const auto g = grid->tree().getValue(openvdb::Coord(x, y, z));
                ASSERT_LT((Vec3d(g.x(), g.y(), g.z()) - slope).norm(), 2e-5);
            }
}

TEST(Derivatives, GradientOfAQuadraticFieldIsExactForCentralDifferences) {
    const int n = 12;
    const Frame frame = centred_frame(n, 2.5);
    const DensityMap map = map_from_function(Vec3i::Constant(n), frame, [](const Vec3d& p) {
        return 0.5 * p.x() * p.x() - 0.25 * p.y() * p.y() + 0.125 * p.x() * p.z();
    });
    const auto grid = gradient(map);
    for (int i = 1; i < n - 1; ++i) {
        const Vec3d p = frame.to_world(Vec3d(i, n - 1 - i, 5));
        const auto g = grid->tree().getValue(openvdb::Coord(i, n - 1 - i, 5));
        EXPECT_NEAR(g.x(), p.x() + 0.125 * p.z(), 1e-4);
        EXPECT_NEAR(g.y(), -0.5 * p.y(), 1e-4);
        EXPECT_NEAR(g.z(), 0.125 * p.x(), 1e-4);
    }
}

/// Largest error of H at voxels between two radii of a ball whose density falls outward.
double curvature_error(int n, const Frame& frame, bool level_set = false) {
    DensityMap map = map_from_function(Vec3i::Constant(n), frame, [&](const Vec3d& p) {
        return level_set ? p.norm() - 20 : std::exp(-p.squaredNorm() / 800);
    });
    if (level_set) map.grid->setGridClass(openvdb::GRID_LEVEL_SET);
    const auto grid = mean_curvature(map);
    double error = 0;
    for (int x = 1; x < n - 1; ++x)
        for (int y = 1; y < n - 1; ++y)
            for (int z = 1; z < n - 1; ++z) {
                const double r = frame.to_world(Vec3d(x, y, z)).norm();
                if (r < 12 || r > 28) continue;
                error = std::max(error, std::abs(grid->tree().getValue(openvdb::Coord(x, y, z)) - 1 / r));
            }
    return error;
}

TEST(Derivatives, MeanCurvatureOfADenseBallIsOneOverItsRadius) {
    const double coarse = curvature_error(33, centred_frame(33, 2));
    const double fine = curvature_error(65, centred_frame(65, 1));
    EXPECT_LT(fine, 1e-3);
    EXPECT_GT(std::log2(coarse / fine), 1.7);  // second order
    EXPECT_LT(curvature_error(65, centred_frame(65, 1), true), 1e-3);
}

TEST(Derivatives, MeanCurvatureInASkewedFrameMeansTheSame) {
    Frame frame = skewed_frame(Vec3i::Constant(64));
    frame.origin = -(frame.axes * Vec3d::Constant(31.5));
    EXPECT_LT(curvature_error(64, frame), 2e-3);
}

TEST(Derivatives, ASaddleHasBothSignsAndAPlaneNone) {
    const int n = 16;
    const DensityMap plane = map_from_function(Vec3i::Constant(n), centred_frame(n, 1),
                                               [](const Vec3d& p) { return 0.3 * p.x() - p.z(); });
    EXPECT_NEAR(mean_curvature(plane)->tree().getValue(openvdb::Coord(7, 7, 7)), 0, 1e-5);
    // A pocket: dense outside a ball.
    const DensityMap pocket = map_from_function(Vec3i::Constant(n), centred_frame(n, 1),
                                                [](const Vec3d& p) { return p.squaredNorm(); });
    EXPECT_LT(mean_curvature(pocket)->tree().getValue(openvdb::Coord(3, 7, 7)), -0.1);
}

TEST(Derivatives, OnlyChosenVoxelsHaveTheSameValues) {
    const int n = 24;
    const DensityMap map = map_from_function(Vec3i::Constant(n), centred_frame(n, 1.5),
                                             [](const Vec3d& p) { return std::exp(-p.squaredNorm() / 100); });
    const auto within = openvdb::BoolGrid::create();
    within->tree().setValueOn(openvdb::Coord(3, 4, 5), true);
    within->tree().setValueOn(openvdb::Coord(17, 9, 16), true);
    within->tree().setValueOn(openvdb::Coord(40, 9, 16), true);  // not a voxel of the map
    const auto some = mean_curvature(map, {within});
    const auto all = mean_curvature(map);
    EXPECT_EQ(some->activeVoxelCount(), 2u);
    EXPECT_EQ(some->tree().getValue(openvdb::Coord(17, 9, 16)),
              all->tree().getValue(openvdb::Coord(17, 9, 16)));
    EXPECT_EQ(some->tree().getValue(openvdb::Coord(17, 10, 16)), 0.0f);
    EXPECT_EQ(gradient(map, {within})->activeVoxelCount(), 2u);
}

}  // namespace
}  // namespace vdbgeo
