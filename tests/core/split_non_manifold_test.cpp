// Sheets that touch get vertices of their own, and nothing moves.
#include "vdbgeo/core/split_non_manifold.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstring>

#include "tests/support/small_meshes.h"
#include "vdbgeo/measure/mesh_measures.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

bool same(const TriMesh& a, const TriMesh& b) { return a.points == b.points && a.triangles == b.triangles; }

}  // namespace

TEST(SplitNonManifold, AManifoldMeshIsNotTouched) {
    for (const TriMesh& mesh :
         {TriMesh(), cube(), icosphere(3, 2), torus_mesh(3, 1), open_cylinder_mesh(1, 2)}) {
        TriMesh split = mesh;
        EXPECT_EQ(split_non_manifold(split), 0u);
        EXPECT_TRUE(same(split, mesh));
    }
}

TEST(SplitNonManifold, CubesThatShareAnEdgeComeApart) {
    TriMesh mesh = two_cubes_sharing_an_edge();
    const std::size_t before = mesh.points.size();
    EXPECT_EQ(split_non_manifold(mesh), 2u);
    ASSERT_EQ(mesh.points.size(), before + 2);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.components, 2u);  // paired across the solid, not across the empty side
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(m.volume_A3.value(), 2, 1e-12);
    // The first twelve faces keep their vertices.
    EXPECT_TRUE(std::equal(mesh.triangles.begin(), mesh.triangles.begin() + 12, cube().triangles.begin()));
}

TEST(SplitNonManifold, HollowsThatShareAnEdgeStayOneSolid) {
    // The same faces turned over: now the solid is outside, and each sheet bounds it on one side.
    TriMesh mesh = flipped(two_cubes_sharing_an_edge());
    split_non_manifold(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.components, 1u);
    EXPECT_NEAR(m.volume_A3.value(), -2, 1e-12);
}

TEST(SplitNonManifold, CubesThatShareAVertexComeApart) {
    TriMesh mesh = two_cubes_sharing_a_vertex();
    mesh.vertex_properties.push_back({"v", 2, std::vector<float>(2 * mesh.points.size())});
    for (std::size_t i = 0; i < mesh.vertex_properties[0].values.size(); ++i)
        mesh.vertex_properties[0].values[i] = float(i);
    EXPECT_EQ(split_non_manifold(mesh), 1u);
    check(mesh, "split");
    EXPECT_EQ(mesh.points.back(), mesh.points[7]);
    EXPECT_EQ(mesh.vertex_properties[0].values.back(), 15);
    EXPECT_TRUE(measure_mesh(mesh).manifold);
}

TEST(SplitNonManifold, ABowtieOfTwoFaces) {
    TriMesh mesh =
        mesh_of({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-1, 0, 0}, {-1, -1, 0}}, {{0, 1, 2}, {0, 3, 4}});
    EXPECT_EQ(split_non_manifold(mesh), 1u);
    EXPECT_EQ(mesh.triangles[0], (Triangle{0, 1, 2}));
    EXPECT_EQ(mesh.triangles[1], (Triangle{5, 3, 4}));
}

TEST(SplitNonManifold, TheThirdFaceOfAnEdgeGetsABorder) {
    // Faces 0 and 2 run through the edge in opposite directions and bound the solid at -y.
    TriMesh mesh =
        mesh_of({{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}}, {{0, 1, 2}, {1, 0, 3}, {1, 0, 4}});
    EXPECT_EQ(split_non_manifold(mesh), 2u);
    EXPECT_EQ(mesh.triangles[0], (Triangle{0, 1, 2}));
    EXPECT_EQ(mesh.triangles[2], (Triangle{1, 0, 4}));
    EXPECT_EQ(mesh.triangles[1], (Triangle{6, 5, 3}));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.manifold && m.oriented);
}

TEST(SplitNonManifold, FacesThatAllRunTheSameWayThroughAnEdgeComeApart) {
    TriMesh mesh =
        mesh_of({{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}}, {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}});
    EXPECT_EQ(split_non_manifold(mesh), 4u);
    EXPECT_EQ(measure_mesh(mesh).components, 3u);
}

TEST(SplitNonManifold, SixFacesAtAnEdgeArePairedWithTheirNeighbours) {
    // Three wedges round the z axis; in each the solid lies between its two faces.
    std::vector<Vec3f> points = {{0, 0, 0}, {0, 0, 1}};
    std::vector<Triangle> faces;
    for (int i = 0; i < 6; ++i) {
        const double u = M_PI / 3 * i + 0.1;
        points.emplace_back(float(std::cos(u)), float(std::sin(u)), 0.5f);
        const VertexId p = VertexId(2 + i);
        faces.push_back(i % 2 == 0 ? Triangle{1, 0, p} : Triangle{0, 1, p});
    }
    std::swap(faces[1], faces[4]);
    TriMesh mesh = mesh_of(points, faces);
    EXPECT_EQ(split_non_manifold(mesh), 4u);
    EXPECT_EQ(measure_mesh(mesh).components, 3u);
    // Wedges (0, 1), (2, 3), (4, 5) by their far points, of which 1 and 4 stand in each other's place.
    EXPECT_EQ(mesh.triangles[0][0], mesh.triangles[4][1]);
    EXPECT_EQ(mesh.triangles[2][0], mesh.triangles[3][1]);
    EXPECT_EQ(mesh.triangles[1][0], mesh.triangles[5][1]);
}

TEST(SplitNonManifold, SheetsThatAreOneFanAtBothEndsGetMiddles) {
    // Two cells that meet in an edge with full cells above and below: both ends of the edge have one fan
    // only.
    TriMesh mesh = cells_mesh(4, [](int x, int y, int z) {
        if (x == 0 || y == 0 || x == 3 || y == 3) return false;
        return z != 1 || x == y;
    });
    const MeshMeasures before = measure_mesh(mesh);
    ASSERT_EQ(before.non_manifold_edges, 1u);
    ASSERT_EQ(before.non_manifold_vertices, 0u);
    mesh.face_properties.push_back({"cap", 1, std::vector<float>(mesh.triangles.size(), 1)});
    EXPECT_EQ(split_non_manifold(mesh), 1u);
    check(mesh, "split");
    EXPECT_EQ(mesh.points.back(), Vec3f(2, 2, 1.5f));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.faces, before.faces + 2);
    EXPECT_NEAR(m.area_A2, before.area_A2, 1e-9);
    EXPECT_EQ(m.genus, 1);
}

TEST(SplitNonManifold, RandomCellsBecomeClosedManifoldsForAnyNumberOfThreads) {
    for (unsigned seed = 1; seed < 40; ++seed) {
        unsigned state = seed;
        std::vector<bool> full(6 * 6 * 6);
        for (std::size_t i = 0; i < full.size(); ++i)
            full[i] = (state = state * 1664525u + 1013904223u) >> 31;
        const auto cells = [&](int x, int y, int z) { return full[std::size_t((z * 6 + y) * 6 + x)]; };
        const TriMesh mesh = cells_mesh(6, cells);
        TriMesh split = mesh, again = mesh;
        EXPECT_GT(split_non_manifold(split), 0u);
        const MeshMeasures m = measure_mesh(split);
        EXPECT_TRUE(m.closed && m.manifold && m.oriented) << seed;
        EXPECT_NEAR(m.volume_A3.value(), double(std::count(full.begin(), full.end(), true)), 1e-9);
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
        split_non_manifold(again);
        EXPECT_TRUE(same(split, again));
    }
}

TEST(SplitNonManifold, OppositeFacesOnTheSameThreePointsAreASheetOfTheirOwn) {
    TriMesh mesh = joined(cube(), mesh_of({}, {}));
    mesh.triangles.push_back({0, 3, 2});
    mesh.triangles.push_back({0, 2, 3});
    split_non_manifold(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
}
