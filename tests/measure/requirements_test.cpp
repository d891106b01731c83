// What a mesh lacks is named with its counts.
#include "vdbgeo/measure/requirements.h"

#include <gtest/gtest.h>

#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

std::string complaint(const TriMesh& mesh, const MeshRequirements& needed) {
    try {
        require(measure_mesh(mesh), needed, "curvature");
    } catch (const InvalidInput& e) {
        return e.what();
    }
    return "";
}

}  // namespace

TEST(Requirements, AGoodMeshPasses) { EXPECT_EQ(complaint(cube(), {true, true, true, true}), ""); }

TEST(Requirements, WhatIsNotAskedForIsNotRefused) {
    EXPECT_EQ(complaint(open_cylinder_mesh(1, 2), {false, true, true}), "");
    EXPECT_EQ(complaint(TriMesh(), {false, false, false, false}), "");
}

TEST(Requirements, AnEmptyMesh) {
    EXPECT_EQ(complaint(TriMesh(), {true, true, true}),
              "curvature needs a mesh that is not empty: it has no faces");
}

TEST(Requirements, AnOpenMesh) {
    EXPECT_EQ(complaint(open_cylinder_mesh(1, 2, 4, 6), {true}),
              "curvature needs a mesh that is closed: the surface is open: 12 boundary edges in 2 holes; try "
              "repair or "
              "--cap");
}

TEST(Requirements, AFlippedFace) {
    TriMesh mesh = cube();
    std::swap(mesh.triangles[3][0], mesh.triangles[3][1]);
    EXPECT_EQ(
        complaint(mesh, {false, true}),
        "curvature needs a mesh that is oriented: 3 edges between faces that face opposite ways; try repair");
}

TEST(Requirements, TouchingCubes) {
    EXPECT_EQ(complaint(two_cubes_sharing_an_edge(), {true, true, true}),
              "curvature needs a mesh that is closed, manifold: 1 edge of three faces or more; try repair");
    EXPECT_EQ(complaint(two_cubes_sharing_a_vertex(), {true, true, true}),
              "curvature needs a mesh that is manifold: 1 vertex where surfaces touch; try repair");
}

TEST(Requirements, SeveralThingsAtOnce) {
    TriMesh mesh = cube();
    mesh.triangles.pop_back();
    mesh.triangles.push_back({0, 0, 1});
    EXPECT_EQ(complaint(mesh, {true, true, true}),
              "curvature needs a mesh that is closed, manifold: the surface is open: 3 boundary edges in 1 "
              "hole; 1 face "
              "that names a vertex twice; try repair or --cap");
}
