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

/// The stencil for the signs of corners A, B, C, D (det(B − A, C − A, D − A) > 0), where AB and CD are the long
/// edges. `even`: whether an even number of A's coordinates are larger than C's.
///
/// A face with two corners inside and one outside leaves a quadrilateral, and both tetrahedra at the face must
/// cut it along the same diagonal. Where one of the two cut edges is long, the diagonal ends at the cut point
/// of the long edge. Where both are short, it ends at that of the two inside corners of which an even number of
/// coordinates are larger than the apex's: they differ in one coordinate, so it is one of them. That is the
/// parity rule of the paper. With it the diagonals on the faces of a prism never run in a circle, and where
/// two corners are inside and two outside the diagonal of the quadrilateral on the surface follows from them.
const Stencil& stencil(Sign a, Sign b, Sign c, Sign d, bool even, bool far_ab, bool far_cd);

}  // namespace vdbgeo::stuffing
