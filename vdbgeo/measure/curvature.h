// What every estimate of curvature gives: values at the vertices of a mesh.
#pragma once

#include <cstdint>
#include <string>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

class VertexFaces;

/// What there is to know of a vertex before its curvature is trusted; bits of Curvatures::flags.
enum CurvatureFlag : std::uint8_t {
    curvature_border = 1,  ///< on an edge of one face, caps not counted: seen from one side only
    curvature_cap = 2,     ///< all its faces are caps (cap_property): no part of the specimen
    curvature_undefined =
        4,  ///< no value: no face with an area, several fans of faces, or too few neighbours
};

/// Curvature at each vertex of a mesh. Å throughout: H, k1 and k2 in 1/Å, K in 1/Å². Normals point outward
/// and a sphere of radius r has H = 1/r, k1 = k2 = 1/r, K = 1/r²; a pit is negative. k1 ≥ k2, H = (k1 +
/// k2)/2, K = k1 k2 (Feng, Xia, Tong, Wei 2012, §2.5, doi:10.1002/cnm.2532). Undefined vertices hold NaN and
/// zero vectors.
struct Curvatures {
    Array<double> K, H, k1, k2;
    /// Unit principal directions, of k1 and of k2, tangent to the surface and perpendicular to each other.
    /// Both are empty where the method gives none. A direction has no sign: `with_stable_sign` chose it.
    Array<Vec3f> direction1, direction2;
    Array<std::uint8_t> flags;

    std::size_t size() const { return flags.size(); }
    bool defined(std::size_t v) const { return !(flags[v] & curvature_undefined); }
    bool has_directions() const { return !direction1.empty(); }
    void resize(std::size_t vertices, bool directions);
    void set_undefined(std::size_t v);
    /// From K and H: k = H ± √max(0, H² − K), Eqs 11 and 12.
    void set_from_invariants(std::size_t v, double gaussian, double mean);
    /// From the principal values in either order; swaps the directions along with them.
    void set_from_principal(std::size_t v, double a, double b, Vec3d along_a, Vec3d along_b);
    void set_from_principal(std::size_t v, double a, double b);
};

/// The same axis with the component of the largest magnitude positive (the first such one): independent of
/// the algorithm's path.
Vec3d with_stable_sign(const Vec3d& axis);

/// Puts a property of the vertices into the mesh, in place of one of the same name where there is one.
void set_vertex_property(TriMesh& mesh, MeshProperty property);

/// Puts the curvature into the mesh as vertex properties: K, H, k1, k2, shape_index, curvedness, type (the
/// number of a SurfaceType), curvature_flags, and direction1, direction2 (3 components) where there are any.
/// Properties of these names are replaced.
void attach(TriMesh& mesh, const Curvatures& curvature, double flatness = 0);

/// Fills flags: border and cap of each vertex as above, undefined where no face with an area is, where an
/// edge has three faces or more, or where the faces form several fans. Throws InvalidInput for a mesh that
/// check() refuses, where two faces run through an edge in the same direction (a Möbius strip, faces turned
/// over: curvature has no sign there; the message says to repair), and where coordinates are so large that
/// 32-bit floats leave no shape: spacing of floats at the largest coordinate above 1/100 of the mean edge.
Array<std::uint8_t> curvature_flags(const TriMesh& mesh, const char* stage);
/// The same for a mesh that has been checked and whose faces at the vertices are known: throws only for faces
/// in the same direction. Curvature by `check_curvature_input` and this needs the list once.
Array<std::uint8_t> curvature_flags(const TriMesh& mesh, const VertexFaces& faces, const char* stage);

}  // namespace vdbgeo
