#include "vdbgeo/volume/placement.h"

#include <gtest/gtest.h>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/derivatives.h"

namespace vdbgeo {
namespace {

using test::map_from_function;

Vec3d world_of(const openvdb::GridBase& grid, int x, int y, int z) {
    const auto p = grid.transform().indexToWorld(openvdb::Coord(x, y, z));
    return {p.x(), p.y(), p.z()};
}

DensityMap small_map() {
    Frame frame;
    frame.axes = 2.0 * Mat3d::Identity();
    frame.origin = Vec3d(100, -50, 7);
    frame.size = Vec3i(5, 7, 9);
    return map_from_function(frame.size, frame, [](const Vec3d& p) { return p.x() + 2 * p.y() + 4 * p.z(); });
}

TEST(Placement, BlenderKeepsTheAxesAndScales) {
    DensityMap map = small_map();
    place(*map.grid, {});
    EXPECT_LT((world_of(*map.grid, 0, 0, 0) - Vec3d(1, -0.5, 0.07)).norm(), 1e-12);
    EXPECT_LT((world_of(*map.grid, 1, 2, 3) - Vec3d(1.02, -0.46, 0.13)).norm(), 1e-12);
    EXPECT_TRUE(map.grid->hasUniformVoxels());
    EXPECT_EQ(map.grid->tree().getValue(openvdb::Coord(1, 2, 3)),
              small_map().grid->tree().getValue({1, 2, 3}));
}

TEST(Placement, HoudiniHasYUp) {
    DensityMap map = small_map();
    PlacementOptions options;
    options.program = SceneProgram::houdini;
    options.units_per_A = 0.1;
    place(*map.grid, options);
    // (x, y, z) → (x, z, -y)
    EXPECT_LT((world_of(*map.grid, 0, 0, 0) - Vec3d(10, 0.7, 5)).norm(), 1e-12);
    EXPECT_LT((world_of(*map.grid, 1, 2, 3) - Vec3d(10.2, 1.3, 4.6)).norm(), 1e-12);
    EXPECT_TRUE(map.grid->hasUniformVoxels());
    EXPECT_GT(frame_of(map.grid->transform()).axes.determinant(), 0);  // a turn, not a mirror
}

TEST(Placement, TheCentreComesToTheOrigin) {
    for (const SceneProgram program : {SceneProgram::blender, SceneProgram::houdini}) {
        DensityMap map = small_map();
        PlacementOptions options;
        options.program = program;
        options.centre_A = centre_of_box(map);
        place(*map.grid, options);
        EXPECT_LT((world_of(*map.grid, 2, 3, 4)).norm(), 1e-12);
    }
    DensityMap unbounded = small_map();
    unbounded.frame.size.setZero();
    EXPECT_LT((centre_of_box(unbounded) - Vec3d(104, -44, 15)).norm(), 1e-12);
}

TEST(Placement, DistancesAreScaledAndStayALevelSet) {
    DensityMap map = map_from_function(Vec3i::Constant(9), test::centred_frame(9, 3.54),
                                       [](const Vec3d& p) { return p.norm() - 7; });
    map.grid->setGridClass(openvdb::GRID_LEVEL_SET);
    map.grid->tree().root().setBackground(3 * 3.54f, true);
    const float before = map.grid->tree().getValue(openvdb::Coord(1, 4, 4));
    PlacementOptions options;
    options.units_per_A = 0.01;
    place(*map.grid, options);
    EXPECT_NEAR(map.grid->tree().getValue(openvdb::Coord(1, 4, 4)), 0.01 * before, 1e-8);
    EXPECT_NEAR(map.grid->background(), 0.03 * 3.54, 1e-8);
    EXPECT_GE(map.grid->background() / map.grid->voxelSize()[0], 3.0 - 1e-7);
}

TEST(Placement, VectorsAreTurnedAndKeepTheirLength) {
    const DensityMap map = small_map();
    const auto grid = gradient(map);
    PlacementOptions options;
    options.program = SceneProgram::houdini;
    place(*grid, options);
    const auto g = grid->tree().getValue(openvdb::Coord(2, 3, 4));
    EXPECT_LT((Vec3d(g.x(), g.y(), g.z()) - Vec3d(1, 4, -2)).norm(), 1e-5);
}

TEST(Placement, CanBeToldAndUndone) {
    for (const SceneProgram program : {SceneProgram::blender, SceneProgram::houdini}) {
        DensityMap map = small_map();
        EXPECT_FALSE(placement_of(*map.grid));
        PlacementOptions options;
        options.program = program;
        options.units_per_A = 0.025;
        options.centre_A = Vec3d(1, 2, 3);
        place(*map.grid, options);
        const auto told = placement_of(*map.grid);
        ASSERT_TRUE(told);
        EXPECT_EQ(told->program, program);
        EXPECT_EQ(told->units_per_A, 0.025);
        EXPECT_EQ(told->centre_A, Vec3d(1, 2, 3));
        EXPECT_THROW(place(*map.grid, options), InvalidInput);  // not twice
        undo_placement(*map.grid);
        EXPECT_FALSE(placement_of(*map.grid));
        const Frame back = frame_of(map.grid->transform());
        EXPECT_LT((back.axes - map.frame.axes).norm(), 1e-12);
        EXPECT_LT((back.origin - map.frame.origin).norm(), 1e-12);
    }
}

TEST(Placement, OptionsAndVoxelsThatMakeNoSceneAreRefused) {
    DensityMap map = small_map();
    PlacementOptions options;
    options.units_per_A = 0;
    EXPECT_THROW(place(*map.grid, options), InvalidInput);
    options.units_per_A = 1e-6;  // voxels of 8e-18 cubic units
    EXPECT_THROW(place(*map.grid, options), InvalidInput);
    EXPECT_FALSE(placement_of(*map.grid));
}

}  // namespace
}  // namespace vdbgeo
