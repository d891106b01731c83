// TriMesh to OpenMesh half-edges and back.
#pragma once

// Eigen's adapter comes after what it specialises and before the meshes.
// clang-format off
#include <OpenMesh/Core/Utils/vector_traits.hh>
#include <OpenMesh/Core/Geometry/EigenVectorT.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
// clang-format on

#include "vdbgeo/core/face_adjacency.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Points in double precision; the status bits that deleting needs.
struct HalfEdgeTraits : OpenMesh::DefaultTraits {
    using Point = Vec3d;
    using Normal = Vec3d;
    using TexCoord2D = Eigen::Vector2f;
    VertexAttributes(OpenMesh::Attributes::Status);
    EdgeAttributes(OpenMesh::Attributes::Status);
    FaceAttributes(OpenMesh::Attributes::Status);
};

using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<HalfEdgeTraits>;

/// The same vertices and faces, numbered alike; unused vertices stay isolated. `adjacency` is that of the
/// mesh: nothing can be dropped, and nothing is searched for a second time. Edges are
/// numbered by the lowest half-edge of the faces that runs along them, which is their half-edge 0, whatever
/// the number of threads. Cost: O(n); 78 bytes a face of a closed mesh (48 in half-edges, 12 in points, 8 in
/// faces, 6 in edges, 4 in vertices) and 12 for a moment.
HalfEdgeMesh to_half_edges(const TriMesh& mesh, const FaceAdjacency& adjacency);

/// The vertices that faces use and the faces, in order, without what is deleted; no properties.
TriMesh to_tri_mesh(const HalfEdgeMesh& mesh);

}  // namespace vdbgeo
