// Which tetrahedra lie against each other.
#pragma once

#include <array>
#include <cstdint>

#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo {

/// neighbour[t][k]: the tetrahedron beyond the face opposite to corner k of tetrahedron t; none at the
/// boundary.
struct TetAdjacency {
    static constexpr std::uint32_t none = 0xFFFFFFFFu;
    Array<std::array<std::uint32_t, 4>> neighbour;
};

/// Pairs the faces of a mesh with good indices (see check()). Throws InvalidInput where a triangle has more
/// than two tetrahedra, or two on the same side (an overlap), where a tetrahedron names a vertex twice, and
/// for 2^30 tetrahedra or more. Cost: O(n), in parallel: some 60 ns a tetrahedron on one core where
/// neighbours are near each other in memory; 16 bytes a tetrahedron, and for a moment 8 and 4 a vertex.
TetAdjacency tet_adjacency(const TetMesh& mesh);

}  // namespace vdbgeo
