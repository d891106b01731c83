#include "vdbgeo/tet/tet_components.h"

#include <gtest/gtest.h>

#include <cmath>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

/// A tetrahedron of three edges of length `side` along the axes from `corner`, added to the mesh.
void add_corner_tet(TetMesh& mesh, const Vec3d& corner, double side, std::int32_t region) {
    const auto v = static_cast<VertexId>(mesh.points.size());
    mesh.points.push_back(corner);
    for (int a = 0; a < 3; ++a) mesh.points.push_back(corner + side * Vec3d::Unit(a));
    mesh.tets.push_back({v, v + 1, v + 2, v + 3});
    mesh.regions.push_back(region);
}

/// Three pieces: a small one, the largest (of two tetrahedra in two regions), a middle one.
TetMesh three_pieces() {
    TetMesh mesh;
    add_corner_tet(mesh, {0, 0, 0}, 1, 1);
    add_corner_tet(mesh, {10, 0, 0}, 3, 1);
    mesh.points.push_back({9, 1, 1});
    mesh.tets.push_back({4, 6, 7, 8});
    std::swap(mesh.tets.back()[1], mesh.tets.back()[2]);
    mesh.regions.push_back(2);
    add_corner_tet(mesh, {20, 0, 0}, 2, 3);
    mesh.vertex_properties.push_back({"x", 1, {}});
    for (const Vec3d& p : mesh.points) mesh.vertex_properties[0].values.push_back(static_cast<float>(p.x()));
    mesh.tet_properties.push_back({"number", 1, {0, 1, 2, 3}});
    set_faces(mesh);
    return mesh;
}

TEST(TetComponents, TheLargestComesFirst) {
    const TetMesh mesh = three_pieces();
    for (std::size_t t = 0; t < 4; ++t) ASSERT_GT(tet_determinant(mesh, t), 0) << t;
    const TetComponents c = tet_components(mesh);
    ASSERT_EQ(c.components.size(), 3u);
    EXPECT_EQ(c.components[0].tets, 2u);
    EXPECT_NEAR(c.components[1].volume_A3, 8.0 / 6, 1e-12);
    EXPECT_NEAR(c.components[2].volume_A3, 1.0 / 6, 1e-12);
    EXPECT_EQ((std::vector<std::uint32_t>(c.of_tet.begin(), c.of_tet.end())),
              (std::vector<std::uint32_t>{2, 0, 0, 1}));
}

TEST(TetComponents, WhatIsKeptKeepsItsNumbers) {
    TetComponentFilter two;
    two.keep_largest = 2;
    const TetMesh mesh = filter_tet_components(three_pieces(), two);
    check(mesh, "kept");
    EXPECT_EQ(mesh.tets.size(), 3u);
    EXPECT_EQ(mesh.points.size(), 9u);
    EXPECT_EQ((std::vector<std::int32_t>(mesh.regions.begin(), mesh.regions.end())),
              (std::vector<std::int32_t>{1, 2, 3}));
    EXPECT_EQ(mesh.tet_properties[0].values, (std::vector<float>{1, 2, 3}));
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
        EXPECT_EQ(mesh.vertex_properties[0].values[v], static_cast<float>(mesh.points[v].x()));
    EXPECT_EQ(mesh.faces.size(), 11u);  // 3 + 3 outside, 1 between, 4
    TetComponentFilter large;
    large.min_volume_A3 = 1.5;
    EXPECT_EQ(filter_tet_components(three_pieces(), large).tets.size(), 2u);
}

TEST(TetComponents, NeutralAndBadFilters) {
    EXPECT_EQ(filter_tet_components(three_pieces(), {}).tets, three_pieces().tets);
    EXPECT_TRUE(tet_components({}).components.empty());
    TetComponentFilter none;
    none.keep_largest = 0;
    EXPECT_THROW(filter_tet_components(three_pieces(), none), InvalidInput);
    TetComponentFilter nan;
    nan.min_volume_A3 = std::nan("");
    EXPECT_THROW(filter_tet_components(three_pieces(), nan), InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
