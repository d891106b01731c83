#include "vdbgeo/surface/level_set.h"

#include <gtest/gtest.h>
#include <openvdb/math/Proximity.h>
#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/LevelSetMeasure.h>
#include <tbb/global_control.h>

#include <cmath>
#include <sstream>

#include "tests/support/maps.h"
#include "tests/support/meshes.h"
#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/volume/phantom.h"
#include "vdbgeo/volume/placement.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using test::centred_frame;
using test::map_from_function;

/// Largest difference to the true distance (positive outside) over the active voxels, in Å.
double distance_error(const FloatGrid& grid, const std::function<double(const Vec3d&)>& truth) {
    double error = 0;
    for (auto it = grid.cbeginValueOn(); it; ++it) {
        const auto p = grid.transform().indexToWorld(it.getCoord());
        error = std::max(error, std::abs(*it - truth(Vec3d(p.x(), p.y(), p.z()))));
    }
    return error;
}

float at_world(const FloatGrid& grid, const Vec3d& p) {
    return grid.tree().getValue(
        grid.transform().worldToIndexCellCentered(openvdb::Vec3d(p.x(), p.y(), p.z())));
}

/// Every voxel nearer than the half width has to be active, and no other.
void expect_whole_band(const FloatGrid& grid, int n, const std::function<double(const Vec3d&)>& truth,
                       double slack) {
    const double width = grid.background();
    for (int x = -4; x < n + 4; ++x)
        for (int y = -4; y < n + 4; ++y)
            for (int z = -4; z < n + 4; ++z) {
                const auto p = grid.transform().indexToWorld(Coord(x, y, z));
                const double d = truth(Vec3d(p.x(), p.y(), p.z()));
                if (std::abs(std::abs(d) - width) < slack) continue;
                ASSERT_EQ(grid.tree().isValueOn(Coord(x, y, z)), std::abs(d) < width)
                    << x << " " << y << " " << z;
                const float far_value = d < 0 ? -grid.background() : grid.background();
                if (std::abs(d) > width) {
                    ASSERT_EQ(grid.tree().getValue(Coord(x, y, z)), far_value);
                }
            }
}

TEST(LevelSet, ASphereIsItsDistance) {
    const double h = 2.5, radius = 30;
    const auto density = [&](const Vec3d& p) { return sphere_field(p, radius); };
    const auto truth = [&](const Vec3d& p) { return -sphere_field(p, radius); };
    const DensityMap map = map_from_function(Vec3i::Constant(40), centred_frame(40, h), density);
    const auto grid = level_set(map, 0);
    EXPECT_EQ(grid->getName(), "surface");
    EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
    EXPECT_EQ(grid->transform(), map.grid->transform());
    EXPECT_LT(distance_error(*grid, truth), 0.03 * h);  // sagitta of a diagonal: 2h²/8R = 0.02 h
    expect_whole_band(*grid, 40, truth, 0.03 * h);
    EXPECT_EQ(openvdb::tools::checkLevelSet(*grid), "");
    EXPECT_NEAR(openvdb::tools::levelSetVolume(*grid), 4.0 / 3 * M_PI * 27000, 0.01 * 4.0 / 3 * M_PI * 27000);
}

TEST(LevelSet, ATorusIsItsDistanceToSecondOrder) {
    const auto density = [](const Vec3d& p) { return torus_field(p, 30, 12); };
    const auto error = [&](int n, double h) {
        const auto grid = level_set(map_from_function(Vec3i::Constant(n), centred_frame(n, h), density), 0);
        EXPECT_EQ(openvdb::tools::checkLevelSet(*grid), "");
        return distance_error(*grid, [&](const Vec3d& p) { return -density(p); });
    };
    const double coarse = error(48, 2), fine = error(96, 1);
    EXPECT_LT(coarse, 0.05 * 2);
    EXPECT_GT(std::log2(coarse / fine), 1.5);
}

TEST(LevelSet, ACavityIsOutsideAndTilesHaveTheirSide) {
    const auto density = [](const Vec3d& p) {
        return 14 - std::abs(p.norm() - 28);
    };  // a shell from 14 to 42
    const DensityMap map = map_from_function(Vec3i::Constant(96), centred_frame(96, 1), density);
    const auto grid = level_set(map, 0);
    EXPECT_EQ(at_world(*grid, Vec3d(0, 0, 0)), 3.0f);    // the cavity
    EXPECT_EQ(at_world(*grid, Vec3d(28, 0, 0)), -3.0f);  // the wall
    EXPECT_EQ(at_world(*grid, Vec3d(0, 46, 0)), 3.0f);
    EXPECT_EQ(at_world(*grid, Vec3d(500, 500, 500)), 3.0f);
    EXPECT_FALSE(grid->tree().hasActiveTiles());
    EXPECT_LT(grid->tree().leafCount(), 12u * 12u * 12u);  // what is constant is no leaf
    expect_whole_band(
        *grid, 96, [&](const Vec3d& p) { return -density(p); }, 0.05);
    EXPECT_EQ(openvdb::tools::checkLevelSet(*grid), "");
}

TEST(LevelSet, ASurfaceThatMeetsTheBorderIsClosedThere) {
    Frame frame = centred_frame(33, 1);
    frame.origin.x() = 0;  // half of the ball is in the box
    const auto density = [](const Vec3d& p) { return 12 - p.norm(); };
    const auto grid = level_set(map_from_function(Vec3i::Constant(33), frame, density), 0);
    EXPECT_EQ(openvdb::tools::checkLevelSet(*grid, 8), "");
    EXPECT_LT(at_world(*grid, Vec3d(0, 0, 0)), 0);
    EXPECT_GT(at_world(*grid, Vec3d(-1, 0, 0)), 0);
    EXPECT_EQ(at_world(*grid, Vec3d(-10, 0, 0)), 3.0f);
    EXPECT_NEAR(openvdb::tools::levelSetVolume(*grid), 2.0 / 3 * M_PI * 1728 + 0.5 * M_PI * 144, 0.08 * 3619);
}

TEST(LevelSet, AMapThatIsDenseAtItsBorderIsAClosedBody) {
    // Dense everywhere but for a hole: the border's median, the background, is above the isovalue.
    const DensityMap map = map_from_function(Vec3i::Constant(40), centred_frame(40, 1),
                                             [](const Vec3d& p) { return p.norm() - 9; });
    ASSERT_GT(map.grid->background(), 0.0f);
    const auto grid = level_set(map, 0);
    EXPECT_EQ(at_world(*grid, Vec3d(0, 0, 0)), 3.0f);
    EXPECT_EQ(at_world(*grid, Vec3d(15, 0, 0)), -3.0f);
    EXPECT_EQ(at_world(*grid, Vec3d(30, 0, 0)), 3.0f);
    EXPECT_EQ(at_world(*grid, Vec3d(-300, 0, 0)), 3.0f);
    EXPECT_EQ(openvdb::tools::checkLevelSet(*grid, 8), "");
    EXPECT_GT(map.grid->background(), 0.0f);  // the map itself is untouched
}

TEST(LevelSet, AnisotropicAndSkewedFramesGetCubesOfTheSmallestVoxel) {
    const auto density = [](const Vec3d& p) { return 20 - p.norm(); };
    const auto truth = [&](const Vec3d& p) { return -density(p); };
    Frame stretched;
    stretched.axes = Vec3d(1, 1.5, 2).asDiagonal();
    stretched.size = Vec3i(60, 40, 30);
    Frame skewed;
    skewed.axes << 1, 0.3, 0, 0, 1.2, 0.2, 0, 0, 1.1;
    skewed.size = Vec3i(60, 50, 50);
    for (Frame frame : {stretched, skewed}) {
        frame.origin = -(frame.axes * (frame.size.array() - 1).matrix().cast<double>() / 2);
        const auto grid = level_set(map_from_function(frame.size, frame, density), 0);
        EXPECT_TRUE(grid->hasUniformVoxels());
        EXPECT_NEAR(grid->voxelSize()[0], frame.voxel_size().minCoeff(), 1e-12);
        EXPECT_LT(distance_error(*grid, truth), 0.05);
        expect_whole_band(*grid, 64, truth, 0.05);
        EXPECT_EQ(openvdb::tools::checkLevelSet(*grid), "");
    }
}

TEST(LevelSet, ATurnedFrameKeepsItsVoxels) {
    Frame frame = centred_frame(40, 1.5);
    frame.axes = 1.5 * Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    frame.origin = -(frame.axes * Vec3d::Constant(19.5));
    const auto density = [](const Vec3d& p) { return 20 - p.norm(); };
    const DensityMap map = map_from_function(Vec3i::Constant(40), frame, density);
    const auto grid = level_set(map, 0);
    EXPECT_EQ(grid->transform(), map.grid->transform());
    EXPECT_LT(distance_error(*grid, [&](const Vec3d& p) { return -density(p); }), 0.05);
    EXPECT_EQ(openvdb::tools::checkLevelSet(*grid), "");
}

/// Distance to the nearest triangle, each one asked.
double brute_force(const TriMesh& mesh, const Vec3d& p) {
    double best = std::numeric_limits<double>::infinity();
    for (const Triangle& t : mesh.triangles) {
        const auto corner = [&](int c) {
            const Vec3f& v = mesh.points[t[static_cast<std::size_t>(c)]];
            return openvdb::Vec3d(v.x(), v.y(), v.z());
        };
        openvdb::Vec3d uvw;
        const openvdb::Vec3d at(p.x(), p.y(), p.z());
        const auto near =
            openvdb::math::closestPointOnTriangleToPoint(corner(0), corner(1), corner(2), at, uvw);
        best = std::min(best, (near - at).length());
    }
    return best;
}

TEST(LevelSet, NoiseAgreesWithEveryTriangleAsked) {
    const Vec3i size(14, 12, 13);
    std::vector<float> values = test::noise(14 * 12 * 13, 7);
    for (float& v : values) v -= 0.4f;
    SparsifyOptions empty;
    empty.background = -1.4f;
    const DensityMap map = test::map_from_values(size, values, {}, empty);
    const auto grid = level_set(map, 0);
    DensityMap unbounded = map;
    unbounded.frame.size.setZero();
    const TriMesh mesh = marching_cubes(unbounded, {0});
    ASSERT_GT(mesh.triangles.size(), 1000u);
    for (int x = -5; x < 19; ++x)
        for (int y = -5; y < 17; ++y)
            for (int z = -5; z < 18; ++z) {
                const Coord ijk(x, y, z);
                const double d = std::min(3.0, brute_force(mesh, Vec3d(x, y, z)));
                ASSERT_NEAR(std::abs(grid->tree().getValue(ijk)), d, 1e-4) << ijk;
                ASSERT_EQ(grid->tree().getValue(ijk) < 0, map.grid->tree().getValue(ijk) >= 0) << ijk;
            }
    EXPECT_EQ(openvdb::tools::checkLevelSet(*grid, 8), "");
}

TEST(LevelSet, ALevelSetIsTakenToo) {
    const auto density = [](const Vec3d& p) { return 12 - p.norm(); };
    const DensityMap map = map_from_function(Vec3i::Constant(32), centred_frame(32, 1), density);
    const auto first = level_set(map, 0);
    const auto second = level_set(map_from_grid(first), 0);
    EXPECT_LT(distance_error(*second, [&](const Vec3d& p) { return -density(p); }), 0.05);
    EXPECT_EQ(at_world(*second, Vec3d(0, 0, 0)), -3.0f);
    EXPECT_EQ(at_world(*second, Vec3d(100, 0, 0)), 3.0f);
}

TEST(LevelSet, PassesOpenVdbsChecksInAScene) {
    const auto density = [](const Vec3d& p) { return 20 - p.norm(); };
    for (const double h : {0.83, 1.061, 2.7, 3.54}) {
        const DensityMap map = map_from_function(Vec3i::Constant(64), centred_frame(64, h), density);
        for (const SceneProgram program : {SceneProgram::blender, SceneProgram::houdini}) {
            const auto grid = level_set(map, 0);
            PlacementOptions options;
            options.program = program;
            place(*grid, options);
            EXPECT_EQ(openvdb::tools::checkLevelSet(*grid), "") << h;
        }
    }
}

std::string bytes_of(const FloatGrid& grid) {
    std::ostringstream out(std::ios::binary);
    grid.writeTopology(out);
    grid.writeBuffers(out);
    return out.str();
}

TEST(LevelSet, TheSameBytesForAnyNumberOfThreads) {
    const Vec3i size(40, 40, 40);
    std::vector<float> values = test::noise(64000, 3);
    for (float& v : values) v -= 0.7f;
    const DensityMap map = test::map_from_values(size, values);
    const auto run = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return bytes_of(*level_set(map, 0));
    };
    const std::string one = run(1);
    EXPECT_TRUE(run(3) == one);
    EXPECT_TRUE(run(2) == one);
}

TEST(LevelSet, BadOptionsAndEmptyLevelsAreRefused) {
    const DensityMap map = map_from_function(Vec3i::Constant(8), centred_frame(8, 1),
                                             [](const Vec3d& p) { return 3 - p.norm(); });
    EXPECT_THROW(level_set(map, 100), NumericalError);
    EXPECT_THROW(level_set(map, std::nan("")), InvalidInput);
    LevelSetOptions narrow;
    narrow.half_width = 1;
    EXPECT_THROW(level_set(map, 0, narrow), InvalidInput);
    LevelSetOptions wide;
    wide.half_width = 6;
    const auto grid = level_set(map, 0, wide);
    expect_whole_band(
        *grid, 8, [](const Vec3d& p) { return p.norm() - 3; }, 0.1);
}

TEST(LevelSet, StopsWhenAskedTo) {
    const DensityMap map = map_from_function(Vec3i::Constant(32), centred_frame(32, 1),
                                             [](const Vec3d& p) { return 12 - p.norm(); });
    for (const double stop : {0.1, 0.5, 0.8})
        EXPECT_THROW(level_set(map, 0, {}, Progress([&](double done) { return done < stop; })), Cancelled);
}

TEST(MeshLevelSet, ABoxOfLargeTrianglesIsItsDistance) {
    // Faces of 400 voxels² each, not aligned with the voxels; the distance to a box is known.
    const Vec3f corner(0.3f, -7.1f, 2.2f);
    const float edge = 9.4f;
    const auto grid = mesh_level_set(test::cube(corner, edge), 0.45, {4.0});
    const auto truth = [&](const Vec3d& p) {
        const Vec3d d = (p - (corner.cast<double>() + Vec3d::Constant(edge / 2.0))).cwiseAbs() -
                        Vec3d::Constant(edge / 2.0);
        return d.cwiseMax(0).norm() + std::min(d.maxCoeff(), 0.0);
    };
    EXPECT_GT(grid->activeVoxelCount(), 10000u);
    EXPECT_LT(distance_error(*grid, truth), 1e-5);
    EXPECT_EQ(at_world(*grid, corner.cast<double>() + Vec3d::Constant(edge / 2.0)), -grid->background());
    EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
}

TEST(MeshLevelSet, CavitiesAreOutside) {
    const TriMesh shell = test::joined(test::icosphere(3, 10), test::flipped(test::icosphere(3, 5)));
    const auto grid = mesh_level_set(shell, 0.5);
    EXPECT_GT(at_world(*grid, Vec3d::Zero()), 0);
    EXPECT_LT(at_world(*grid, Vec3d(7.5, 0, 0)), 0);
    EXPECT_GT(at_world(*grid, Vec3d(0, 11, 0)), 0);
    const auto truth = [](const Vec3d& p) { return std::max(p.norm() - 10, 5 - p.norm()); };
    EXPECT_LT(distance_error(*grid, truth), 0.1);  // of the faces' chords
}

TEST(MeshLevelSet, BadInputIsRefused) {
    EXPECT_THROW(mesh_level_set({}, 1), InvalidInput);
    EXPECT_THROW(mesh_level_set(test::cube(), 0), InvalidInput);
    EXPECT_THROW(mesh_level_set(test::cube(), 1e-12), InvalidInput);
    EXPECT_THROW(mesh_level_set(test::cube(), std::nan("")), InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
