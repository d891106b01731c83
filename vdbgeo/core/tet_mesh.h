// The plain indexed tetrahedral mesh: what the tetrahedralizers make, with its boundary and its regions.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Corners a, b, c, d with det(b − a, c − a, d − a) > 0: seen from d, the corners a, b, c run
/// counter-clockwise. This is the order of VTK, Gmsh and Medit.
using Tetrahedron = std::array<VertexId, 4>;

/// The corners of the face opposite to corner k, counter-clockwise seen from outside.
inline constexpr std::array<std::array<int, 3>, 4> tet_faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// The corners at the ends of each of the six edges.
inline constexpr std::array<std::array<int, 2>, 6> tet_edges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

/// Tetrahedra over shared points, in Å. Points are doubles: what is computed in doubles is not turned over by
/// rounding, and the points of a TriMesh are kept as they are.
struct TetMesh {
    Array<Vec3d> points;
    Array<Tetrahedron> tets;
    /// The region (subdomain, label) of each tetrahedron, 1 or more; empty: all are 1.
    Array<std::int32_t> regions;

    /// The triangles between two regions, and between a region and the outside: each once, sorted by the
    /// tetrahedron in front and its face. Counter-clockwise seen from outside of the region face_regions[0].
    /// Empty until set_faces was called; every tetrahedralizer calls it or does as much.
    Array<Triangle> faces;
    /// The regions behind and before each face: {inside, outside}. Outside is 0 on the boundary; between two
    /// regions inside is the smaller number.
    Array<std::array<std::int32_t, 2>> face_regions;

    std::vector<MeshProperty> vertex_properties;
    std::vector<MeshProperty> tet_properties;

    bool empty() const { return tets.empty(); }
    std::int32_t region(std::size_t tet) const { return regions.empty() ? 1 : regions[tet]; }
    const MeshProperty* find_vertex_property(const std::string& name) const;
    const MeshProperty* find_tet_property(const std::string& name) const;
};

/// Throws InvalidInput unless every tetrahedron and face names existing points, every coordinate is finite,
/// there are as many regions (1 or more each) as tetrahedra or none, as many pairs of regions as faces, and
/// every property has as many values as the mesh has elements. `what` begins the message (a file's name, say).
/// Turned-over tetrahedra are let through: they are measured (tet_quality.h).
void check(const TetMesh& mesh, const std::string& what);

/// Six times the signed volume of a tetrahedron: det(b − a, c − a, d − a).
inline double tet_determinant(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    return (b - a).cross(c - a).dot(d - a);
}
inline double tet_determinant(const TetMesh& mesh, std::size_t tet) {
    const Tetrahedron& t = mesh.tets[tet];
    return tet_determinant(mesh.points[t[0]], mesh.points[t[1]], mesh.points[t[2]], mesh.points[t[3]]);
}

/// Sets `faces` and `face_regions` from the tetrahedra and their regions. Throws InvalidInput where a triangle
/// has more than two tetrahedra, or two on the same side. Cost: that of tet_adjacency.
void set_faces(TetMesh& mesh);

/// The boundary of the mesh as a triangle mesh of its own (faces whose outside is 0), vertices in the order of
/// the mesh and rounded to floats; with `region`: the whole boundary of that region, turned outward from it.
/// The face property `region` tells the region behind each face. Needs faces.
TriMesh boundary_surface(const TetMesh& mesh, std::int32_t region = 0);

}  // namespace vdbgeo
