// Vertex moves that raise the worst dihedral angle around a vertex. For tet_optimize.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/tet/tet_optimize.h"
#include "vdbgeo/tet/tet_store.h"

namespace vdbgeo {

/// Moves each of `vertices` (sorted, none twice) that may move to where the worst tetrahedron around it is
/// better, and nothing where there is no such place. `tried[v]` is when it was tried in vain last: it is left
/// alone while nothing around it changed since. `epoch` counts on. Returns how many moved.
///
/// What is maximised, min over the star's angles of q (see DihedralBounds), is a minimum of smooth functions.
/// Each step maximises the minimum of their linear parts less |d|²/2τ over moves d (a proximal bundle method:
/// Kiwiel 1985, doi:10.1007/BFb0074500), is taken where the true worst is better, and shortened where not.
/// Boundary vertices move in their tangent plane and back onto the surface.
///
/// Vertices of one colour of a greedy colouring share no tetrahedron and are moved at once.
std::uint64_t move_vertices(TetStore& store, const std::vector<VertexId>& vertices,
                            const SurfaceProjection& onto_surface, std::vector<std::uint32_t>& tried,
                            std::uint32_t& epoch, const Progress& progress);

}  // namespace vdbgeo
