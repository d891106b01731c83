// How a tetrahedron of the lattice is cut. For isosurface_stuffing; nothing outside this folder needs it.
#pragma once

#include <array>
#include <cstdint>

namespace vdbgeo::stuffing {

/// Where a point of the lattice is: outside, inside, or (snapped) on the surface.
enum class Sign : std::uint8_t { minus = 0, zero = 1, plus = 2 };

/// Up to three tetrahedra of the inside. Corners 0…3 are those of the lattice's tetrahedron, 4 + e is the
/// cut point on its edge e (as tet_edges counts).
struct Stencil {
    int count = 0;
    std::array<std::array<std::uint8_t, 4>, 3> tets{};
};

/// The stencil for the signs of corners A, B, C, D (det(B − A, C − A, D − A) > 0), where AB and CD are the
/// long edges. `even`: whether an even number of A's coordinates are larger than C's. `far_ab`, `far_cd`:
/// whether the cut point of that edge is nearer to the outside end than to the inside one.
///
/// A face with two corners inside and one outside leaves a quadrilateral, and both tetrahedra at the face
/// must divide it along the same diagonal, so the choice may depend on the face alone:
/// - Both cut edges are short: the diagonal ends at that of the two inside corners of which an even number of
///   coordinates are larger than the outside corner's. The inside corners differ in one coordinate, so it is
///   one of them. (This is the parity rule of the paper.)
/// - One of them is long: the diagonal ends at the cut point of the long edge, as in the paper, unless that
/// is far:
///   then it ends at the cut point of the short edge. Long diagonals are so avoided, and the least angle at
///   the best distances for snapping rises from 10.8° to 11.7°.
///
/// With three corners inside, the two faces of the second kind share the long edge and take the same choice,
/// so the diagonals on the faces of the prism do not run in a circle, and it has a triangulation. With two
/// inside and two outside, the diagonal of the quadrilateral on the surface follows from the others, or
/// (where the two edges that are long choose differently) joins the cut point from the first inside to the
/// first outside corner and that from the second to the second.
const Stencil& stencil(Sign a, Sign b, Sign c, Sign d, bool even, bool far_ab, bool far_cd);

}  // namespace vdbgeo::stuffing
