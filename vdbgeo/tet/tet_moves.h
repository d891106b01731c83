// Vertex moves that raise the worst dihedral angle around a vertex. For tet_optimize.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/tet/tet_optimize.h"
#include "vdbgeo/tet/tet_store.h"

namespace vdbgeo {

/// Moves each of `vertices` (sorted, none twice) that may move to where the worst angle around it is better
/// (see ascend and DihedralBounds), and those not for which there is no such place. Boundary vertices move in
/// their tangent plane and back onto the surface. `tried[v]` is when v was tried in vain last: it is left
/// alone while nothing around it changed since; `epoch` counts on. Vertices of one colour of a greedy
/// colouring share no tetrahedron and are moved at once. Returns how many moved.
std::uint64_t move_vertices(TetStore& store, const std::vector<VertexId>& vertices,
                            const SurfaceProjection& onto_surface, std::vector<std::uint32_t>& tried,
                            std::uint32_t& epoch, const Progress& progress);

}  // namespace vdbgeo
