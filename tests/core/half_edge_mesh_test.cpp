// OpenMesh grows its arrays by default-made elements, and Eigen's vectors leave those unset.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

#include "vdbgeo/core/half_edge_mesh.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <vector>

#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

HalfEdgeMesh half_edges(const TriMesh& mesh) { return to_half_edges(mesh, face_adjacency(mesh, "test")); }

/// The same mesh, built by OpenMesh face by face.
HalfEdgeMesh added(const TriMesh& mesh) {
    HalfEdgeMesh out;
    for (const Vec3f& p : mesh.points) out.add_vertex(p.cast<double>());
    const auto vertex = [](VertexId v) { return OpenMesh::VertexHandle(static_cast<int>(v)); };
    for (const Triangle& t : mesh.triangles) out.add_face(vertex(t[0]), vertex(t[1]), vertex(t[2]));
    return out;
}

void expect_same(const HalfEdgeMesh& a, const HalfEdgeMesh& b) {
    ASSERT_EQ(a.n_vertices(), b.n_vertices());
    ASSERT_EQ(a.n_edges(), b.n_edges());
    ASSERT_EQ(a.n_faces(), b.n_faces());
    // OpenMesh numbers edges alike, but may begin them at either end.
    for (const auto& h : a.halfedges()) {
        const OpenMesh::HalfedgeHandle other = b.find_halfedge(h.from(), h.to());
        ASSERT_TRUE(other.is_valid());
        EXPECT_EQ(h.edge(), b.edge_handle(other));
        EXPECT_EQ(h.face(), b.face_handle(other));
        EXPECT_EQ(h.next().to(), b.to_vertex_handle(b.next_halfedge_handle(other)));
        EXPECT_EQ(h.prev().from(), b.from_vertex_handle(b.prev_halfedge_handle(other)));
        EXPECT_EQ(a.next_halfedge_handle(h.prev()), h);
    }
    for (const auto& v : a.vertices()) {
        EXPECT_EQ(a.point(v), b.point(v));
        EXPECT_EQ(a.is_isolated(v), b.is_isolated(v));
        EXPECT_EQ(a.is_boundary(v), b.is_boundary(v));
        if (a.is_isolated(v)) continue;
        EXPECT_EQ(a.valence(v), b.valence(v));
        EXPECT_EQ(a.is_boundary(a.halfedge_handle(v)), a.is_boundary(v));
    }
    for (const auto& f : a.faces()) EXPECT_EQ(f.halfedge().face(), f);
}

TEST(HalfEdgeMesh, IsWhatOpenMeshBuilds) {
    expect_same(half_edges(test::icosphere(2, 1)), added(test::icosphere(2, 1)));
    expect_same(half_edges(test::torus_mesh(3, 1, 20, 10)), added(test::torus_mesh(3, 1, 20, 10)));
    expect_same(half_edges(test::open_cylinder_mesh(1, 2, 3, 8)),
                added(test::open_cylinder_mesh(1, 2, 3, 8)));
    TriMesh isolated = test::cube();
    isolated.points.emplace_back(9.f, 9.f, 9.f);
    expect_same(half_edges(isolated), added(isolated));
    EXPECT_EQ(half_edges({}).n_edges(), 0u);
}

TEST(HalfEdgeMesh, EveryBorderIsALoop) {
    const HalfEdgeMesh mesh = half_edges(test::open_cylinder_mesh(1, 2, 3, 8));
    int loops = 0;
    std::vector<bool> seen(mesh.n_halfedges(), false);
    for (const auto& h : mesh.halfedges()) {
        if (!mesh.is_boundary(h) || seen[std::size_t(h.idx())]) continue;
        ++loops;
        int length = 0;
        for (OpenMesh::HalfedgeHandle x = h; !seen[std::size_t(x.idx())]; x = mesh.next_halfedge_handle(x)) {
            seen[std::size_t(x.idx())] = true;
            ++length;
        }
        EXPECT_EQ(length, 8);
    }
    EXPECT_EQ(loops, 2);
}

TEST(HalfEdgeMesh, GoesBackToTheSameTriangles) {
    const TriMesh mesh = test::torus_mesh(3, 1, 200, 100);
    const auto with_threads = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return half_edges(mesh);
    };
    const HalfEdgeMesh one = with_threads(1), two = with_threads(2);
    EXPECT_EQ(to_tri_mesh(one).points, mesh.points);
    EXPECT_EQ(to_tri_mesh(one).triangles, mesh.triangles);
    for (const auto& h : one.halfedges()) {
        ASSERT_EQ(h.to(), two.to_vertex_handle(h));
        ASSERT_EQ(h.next(), two.next_halfedge_handle(h));
    }
}

}  // namespace
}  // namespace vdbgeo
