// OpenMesh grows its arrays by default-made elements, and Eigen's vectors leave those unset.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

#include "vdbgeo/core/half_edge_mesh.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = FaceAdjacency::none;

/// Joins the half-edges along the borders, and makes those of border vertices their first ones, as OpenMesh
/// has it.
void link_borders(const FaceAdjacency& adjacency, const Array<int>& handles, HalfEdgeMesh& out) {
    for (std::size_t v = 0; v < adjacency.outgoing.size(); ++v) {
        const std::uint32_t first = adjacency.outgoing[v];
        if (first == none) continue;
        const OpenMesh::VertexHandle vertex(static_cast<int>(v));
        const OpenMesh::HalfedgeHandle leaving(handles[first]);
        if (adjacency.twin[first] != none) {
            out.set_halfedge_handle(vertex, leaving);
            continue;
        }
        std::uint32_t last = first;
        for (std::uint32_t h = first; h != none; h = adjacency.around(h)) last = h;
        const OpenMesh::HalfedgeHandle arriving(handles[FaceAdjacency::previous(last)]);
        out.set_next_halfedge_handle(out.opposite_halfedge_handle(leaving),
                                     out.opposite_halfedge_handle(arriving));
        out.set_halfedge_handle(vertex, out.opposite_halfedge_handle(arriving));
    }
}

}  // namespace

HalfEdgeMesh to_half_edges(const TriMesh& mesh, const FaceAdjacency& adjacency) {
    HalfEdgeMesh out;
    const std::uint32_t count = static_cast<std::uint32_t>(adjacency.twin.size());
    out.reserve(mesh.points.size(), count / 2, mesh.triangles.size());
    for (const Vec3f& p : mesh.points) out.new_vertex(p.cast<double>());
    Array<int> handles(count);
    for (std::uint32_t h = 0; h < count; ++h) {
        const std::uint32_t twin = adjacency.twin[h];
        const Triangle& t = mesh.triangles[h / 3];
        if (twin != none && twin < h)
            handles[h] = handles[twin] ^ 1;
        else
            handles[h] = out.new_edge(OpenMesh::VertexHandle(static_cast<int>(t[h % 3])),
                                      OpenMesh::VertexHandle(static_cast<int>(t[(h + 1) % 3])))
                             .idx();
    }
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const OpenMesh::FaceHandle face = out.new_face();
        for (std::size_t k = 0; k < 3; ++k) {
            const OpenMesh::HalfedgeHandle h(handles[3 * f + k]);
            out.set_face_handle(h, face);
            out.set_next_halfedge_handle(h, OpenMesh::HalfedgeHandle(handles[3 * f + (k + 1) % 3]));
        }
        out.set_halfedge_handle(face, OpenMesh::HalfedgeHandle(handles[3 * f]));
    }
    link_borders(adjacency, handles, out);
    return out;
}

TriMesh to_tri_mesh(const HalfEdgeMesh& mesh) {
    TriMesh out;
    std::vector<VertexId> number(mesh.n_vertices());
    for (int v = 0; v < static_cast<int>(mesh.n_vertices()); ++v) {
        const OpenMesh::VertexHandle vertex(v);
        if (mesh.status(vertex).deleted() || mesh.is_isolated(vertex)) continue;
        number[static_cast<std::size_t>(v)] = static_cast<VertexId>(out.points.size());
        out.points.push_back(mesh.point(vertex).cast<float>());
    }
    out.triangles.reserve(mesh.n_faces());
    for (int f = 0; f < static_cast<int>(mesh.n_faces()); ++f) {
        const OpenMesh::FaceHandle face(f);
        if (mesh.status(face).deleted()) continue;
        OpenMesh::HalfedgeHandle h = mesh.halfedge_handle(face);
        Triangle t;
        for (VertexId& corner : t) {
            corner = number[static_cast<std::size_t>(mesh.from_vertex_handle(h).idx())];
            h = mesh.next_halfedge_handle(h);
        }
        out.triangles.push_back(t);
    }
    return out;
}

}  // namespace vdbgeo
