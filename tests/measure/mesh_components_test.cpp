// Pieces of known meshes; what is kept of them.
#include "vdbgeo/measure/mesh_components.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

TriMesh filtered(const TriMesh& mesh, const ComponentFilter& filter) {
    return filter_components(mesh, filter);
}

/// A shell of edge 10 with a cavity in which a shell of edge 4 stands, which has a cavity too; and a small
/// shell outside.
TriMesh nested() {
    TriMesh mesh = joined(cube({0, 0, 0}, 1), cube({10, 0, 0}, 10));
    mesh = joined(mesh, flipped(cube({11, 1, 1}, 8)));
    mesh = joined(mesh, cube({13, 3, 3}, 4));
    return joined(mesh, flipped(cube({14, 4, 4}, 2)));
}

std::size_t pieces(const TriMesh& mesh) { return mesh_components(mesh).components.size(); }

}  // namespace

TEST(MeshComponents, PiecesComeByAreaWithTheirMeasures) {
    const MeshComponents found = mesh_components(nested());
    ASSERT_EQ(found.components.size(), 5u);
    const double volumes[] = {1000, -512, 64, -8, 1};
    for (std::size_t i = 0; i < 5; ++i) {
        const MeshComponent& c = found.components[i];
        EXPECT_NEAR(c.volume_A3.value(), volumes[i], 1e-9);
        EXPECT_EQ(c.cavity(), volumes[i] < 0);
        EXPECT_NEAR(c.area_A2, 6 * std::pow(std::abs(volumes[i]), 2.0 / 3), 1e-9);
        EXPECT_FALSE(c.touches_border);
        EXPECT_EQ(c.vertices, 8u);
        EXPECT_EQ(c.faces, 12u);
        EXPECT_NEAR((c.centroid - (i == 4 ? Vec3d(0.5, 0.5, 0.5) : Vec3d(15, 5, 5))).norm(), 0, 1e-9);
    }
    EXPECT_EQ(found.of_face[0], 4u);
    EXPECT_EQ(found.of_face[12], 0u);
}

TEST(MeshComponents, EqualAreasComeInTheOrderOfTheirFaces) {
    const MeshComponents found = mesh_components(joined(cube({5, 0, 0}), cube()));
    EXPECT_EQ(found.of_face.front(), 0u);
    EXPECT_EQ(found.of_face.back(), 1u);
}

TEST(MeshComponents, OpenPiecesHaveNoVolumeAndTouchTheBorder) {
    const MeshComponents found = mesh_components(joined(open_cylinder_mesh(1, 2), cube({9, 9, 9})));
    ASSERT_EQ(found.components.size(), 2u);
    EXPECT_TRUE(found.components[0].touches_border);
    EXPECT_FALSE(found.components[0].volume_A3);
    EXPECT_FALSE(found.components[1].touches_border);
}

TEST(MeshComponents, CapsTouchTheBorderAndAreLeftOutOfTheArea) {
    TriMesh mesh = cube();
    mesh.face_properties.push_back({cap_property, 1, std::vector<float>(12, 0)});
    mesh.face_properties[0].values[0] = mesh.face_properties[0].values[1] = 1;  // at z = 0
    const MeshComponents found = mesh_components(mesh);
    EXPECT_TRUE(found.components[0].touches_border);
    EXPECT_EQ(found.components[0].area_A2, 5);
    EXPECT_NEAR(found.components[0].centroid.z(), 0.6, 1e-12);
    EXPECT_NEAR(found.components[0].volume_A3.value(), 1, 1e-12);
}

TEST(MeshComponents, AFlippedFaceLeavesNoVolume) {
    TriMesh mesh = cube();
    std::swap(mesh.triangles[3][0], mesh.triangles[3][1]);
    EXPECT_FALSE(mesh_components(mesh).components[0].volume_A3);
}

TEST(MeshComponents, DegenerateFacesConnectNothing) {
    TriMesh mesh = joined(cube(), cube({3, 0, 0}));
    mesh.triangles.push_back({0, 8, 8});
    const MeshComponents found = mesh_components(mesh);
    EXPECT_EQ(found.components.size(), 2u);
    EXPECT_EQ(found.components[0].faces, 13u);
    EXPECT_TRUE(found.components[1].volume_A3);
}

TEST(MeshComponents, AnEmptyMeshHasNone) {
    EXPECT_TRUE(mesh_components(TriMesh()).components.empty());
    EXPECT_TRUE(filtered(TriMesh(), {2}).empty());
}

TEST(MeshComponents, CavitiesKnowTheirShells) {
    const TriMesh mesh = nested();
    const auto shells = shells_of_cavities(mesh, mesh_components(mesh));
    const std::optional<std::uint32_t> no;
    EXPECT_EQ(shells, (std::vector<std::optional<std::uint32_t>>{no, 0, no, 2, no}));
}

TEST(MeshComponents, ACavityBehindAnotherFindsTheShell) {
    TriMesh mesh = joined(cube({0, 0, 0}, 10), flipped(cube({1, 1, 1}, 2)));
    mesh = joined(mesh, flipped(cube({5, 1, 1}, 3)));
    const auto shells = shells_of_cavities(mesh, mesh_components(mesh));
    EXPECT_EQ(shells[1], 0u);
    EXPECT_EQ(shells[2], 0u);
}

TEST(MeshComponents, ManyCavitiesInManyShells) {
    // Spheres with hollows of several sizes on a lattice: each hollow finds its own.
    TriMesh mesh;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 5; ++j) {
            const Vec3d at(3.0 * i, 2.5 * j, 0.3 * i);
            mesh = joined(mesh, moved(icosphere(2, 1), Mat3d::Identity(), at));
            mesh =
                joined(mesh, moved(flipped(icosphere(1, 0.3 + 0.01 * (5 * i + j))), Mat3d::Identity(), at));
        }
    const MeshComponents found = mesh_components(mesh);
    const auto shells = shells_of_cavities(mesh, found);
    std::size_t cavities = 0;
    for (std::size_t id = 0; id < shells.size(); ++id) {
        ASSERT_EQ(shells[id].has_value(), found.components[id].cavity());
        if (!shells[id]) continue;
        ++cavities;
        EXPECT_LT((found.components[*shells[id]].centroid - found.components[id].centroid).norm(), 1e-5);
    }
    EXPECT_EQ(cavities, 30u);
}

TEST(ComponentFilter, NeutralGivesTheMeshBack) {
    TriMesh mesh = nested();
    mesh.points.push_back(Vec3f(1, 2, 3));
    EXPECT_EQ(filtered(mesh, {}).points, mesh.points);
    EXPECT_EQ(filtered(mesh, {}).triangles, mesh.triangles);
}

TEST(ComponentFilter, TheLargestStayWithTheirCavities) {
    ComponentFilter filter;
    filter.keep_largest = 1;
    EXPECT_NEAR(measure_mesh(filtered(nested(), filter)).volume_A3.value(), 1000 - 512, 1e-9);
    filter.keep_largest = 2;
    EXPECT_NEAR(measure_mesh(filtered(nested(), filter)).volume_A3.value(), 1000 - 512 + 64 - 8, 1e-9);
    filter.keep_largest = 99;
    EXPECT_EQ(pieces(filtered(nested(), filter)), 5u);
}

TEST(ComponentFilter, ACavityGoesWithItsShell) {
    ComponentFilter filter;
    filter.min_area_A2 = 97;  // the shell of edge 4 has 96
    EXPECT_EQ(pieces(filtered(nested(), filter)), 2u);
    filter = {};
    filter.min_volume_A3 = 10;  // the inner cavity alone
    EXPECT_NEAR(measure_mesh(filtered(nested(), filter)).volume_A3.value(), 1000 - 512 + 64, 1e-9);
}

TEST(ComponentFilter, CavitiesAndBorderPiecesCanGo) {
    ComponentFilter filter;
    filter.drop_cavities = true;
    EXPECT_EQ(pieces(filtered(nested(), filter)), 3u);
    filter = {};
    filter.drop_border = true;
    const TriMesh mesh = joined(open_cylinder_mesh(1, 2), cube({9, 9, 9}));
    EXPECT_EQ(filtered(mesh, filter).triangles, cube().triangles);
    filter = {};
    filter.min_volume_A3 = 1e9;
    EXPECT_EQ(pieces(filtered(mesh, filter)), 1u);  // the open one stays
}

TEST(ComponentFilter, PropertiesAndOrderStay) {
    TriMesh mesh = joined(cube({5, 0, 0}, 2), joined(cube(), cube({9, 9, 9}, 2)));
    mesh.vertex_properties.push_back({"v", 2, {}});
    for (std::size_t i = 0; i < 2 * mesh.points.size(); ++i)
        mesh.vertex_properties[0].values.push_back(float(i));
    mesh.face_properties.push_back({"f", 1, {}});
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        mesh.face_properties[0].values.push_back(float(i));
    ComponentFilter filter;
    filter.keep_largest = 2;
    const TriMesh kept = filtered(mesh, filter);
    check(kept, "kept");
    ASSERT_EQ(kept.points.size(), 16u);
    EXPECT_EQ(kept.points[8], mesh.points[16]);
    EXPECT_EQ(kept.vertex_properties[0].values[17], 33);
    EXPECT_EQ(kept.face_properties[0].values[12], 24);
    EXPECT_EQ(kept.triangles[12], (Triangle{8, 10, 11}));
}

TEST(ComponentFilter, BadValuesAreRefused) {
    ComponentFilter filter;
    filter.keep_largest = 0;
    EXPECT_THROW(filter.check(), InvalidInput);
    filter = {};
    filter.min_volume_A3 = -1;
    EXPECT_THROW(filter.check(), InvalidInput);
    EXPECT_THROW(extract_components(cube(), mesh_components(cube()), {}), InvalidInput);
}
