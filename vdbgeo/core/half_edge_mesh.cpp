// OpenMesh grows its arrays by default-made elements, and Eigen's vectors leave those unset.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

#include "vdbgeo/core/half_edge_mesh.h"

#include <utility>
#include <vector>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = FaceAdjacency::none;
constexpr std::size_t grain = 1 << 14;

/// Joins the half-edges along the border at a vertex, and makes that of a border vertex its first one, as
/// OpenMesh has it.
void link_vertex(const FaceAdjacency& adjacency, const Array<int>& handles, std::size_t v,
                 HalfEdgeMesh& out) {
    const std::uint32_t first = adjacency.outgoing[v];
    if (first == none) return;
    const OpenMesh::VertexHandle vertex(static_cast<int>(v));
    const OpenMesh::HalfedgeHandle leaving(handles[first]);
    if (adjacency.twin[first] != none) {
        out.set_halfedge_handle(vertex, leaving);
        return;
    }
    std::uint32_t last = first;
    for (std::uint32_t h = first; h != none; h = adjacency.around(h)) last = h;
    const OpenMesh::HalfedgeHandle arriving(handles[FaceAdjacency::previous(last)]);
    out.set_next_halfedge_handle(out.opposite_halfedge_handle(leaving),
                                 out.opposite_halfedge_handle(arriving));
    out.set_halfedge_handle(vertex, out.opposite_halfedge_handle(arriving));
}

/// Whether a half-edge is its edge's first.
bool leads(const FaceAdjacency& adjacency, std::size_t h) {
    const std::uint32_t twin = adjacency.twin[h];
    return twin == none || twin > h;
}

struct Numbering {
    Array<int> handles;  ///< of the half-edges of the faces
    std::size_t edges = 0;
};

/// Edges in order of their first half-edges: each block begins where those before it end.
Numbering number_edges(const FaceAdjacency& adjacency) {
    Numbering out;
    const std::size_t count = adjacency.twin.size();
    std::vector<std::size_t> start(count / grain + 1);
    parallel_blocks(count, grain, [&](std::size_t begin, std::size_t end) {
        std::size_t edges = 0;
        for (std::size_t h = begin; h < end; ++h) edges += leads(adjacency, h);
        start[begin / grain] = edges;
    });
    for (std::size_t& s : start) out.edges += std::exchange(s, out.edges);
    out.handles.resize(count);
    parallel_blocks(count, grain, [&](std::size_t begin, std::size_t end) {
        std::size_t edge = start[begin / grain];
        for (std::size_t h = begin; h < end; ++h)
            if (leads(adjacency, h)) out.handles[h] = static_cast<int>(2 * edge++);
    });
    parallel_for(count, grain, [&](std::size_t h) {
        if (!leads(adjacency, h)) out.handles[h] = out.handles[adjacency.twin[h]] ^ 1;
    });
    return out;
}

/// The face's half-edges, and the other side of those at a border: nobody else knows where it goes to.
void link_face(const TriMesh& mesh, const FaceAdjacency& adjacency, const Array<int>& handles, std::size_t f,
               HalfEdgeMesh& out) {
    const OpenMesh::FaceHandle face(static_cast<int>(f));
    const Triangle& t = mesh.triangles[f];
    for (std::size_t k = 0; k < 3; ++k) {
        const OpenMesh::HalfedgeHandle h(handles[3 * f + k]);
        out.set_vertex_handle(h, OpenMesh::VertexHandle(static_cast<int>(t[(k + 1) % 3])));
        out.set_face_handle(h, face);
        out.set_next_halfedge_handle(h, OpenMesh::HalfedgeHandle(handles[3 * f + (k + 1) % 3]));
        if (adjacency.twin[3 * f + k] == none)
            out.set_vertex_handle(out.opposite_halfedge_handle(h),
                                  OpenMesh::VertexHandle(static_cast<int>(t[k])));
    }
    out.set_halfedge_handle(face, OpenMesh::HalfedgeHandle(handles[3 * f]));
}

}  // namespace

HalfEdgeMesh to_half_edges(const TriMesh& mesh, const FaceAdjacency& adjacency) {
    HalfEdgeMesh out;
    const Numbering numbers = number_edges(adjacency);
    out.resize(mesh.points.size(), numbers.edges, mesh.triangles.size());
    parallel_for(mesh.triangles.size(), grain,
                 [&](std::size_t f) { link_face(mesh, adjacency, numbers.handles, f, out); });
    parallel_for(mesh.points.size(), grain, [&](std::size_t v) {
        out.set_point(OpenMesh::VertexHandle(static_cast<int>(v)), mesh.points[v].cast<double>());
        link_vertex(adjacency, numbers.handles, v, out);
    });
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
