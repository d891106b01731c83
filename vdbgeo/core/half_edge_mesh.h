// TriMesh to OpenMesh half-edges and back.
#pragma once

// Eigen's adapter comes after what it specialises and before the meshes.
// clang-format off
#include <OpenMesh/Core/Utils/vector_traits.hh>
#include <OpenMesh/Core/Geometry/EigenVectorT.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
// clang-format on

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/core/face_adjacency.h"

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
/// mesh: nothing can be dropped, and nothing is searched for a second time. Half-edge 0 of an edge is its
/// face's lowest.
HalfEdgeMesh to_half_edges(const TriMesh& mesh, const FaceAdjacency& adjacency);

/// The vertices that faces use and the faces, in order, without what is deleted; no properties.
TriMesh to_tri_mesh(const HalfEdgeMesh& mesh);

}  // namespace vdbgeo
