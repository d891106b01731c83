// Moves of all corners of a tetrahedron together, where one at a time is stuck. For tet_optimize.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/tet/tet_optimize.h"
#include "vdbgeo/tet/tet_store.h"

namespace vdbgeo {

/// Moves the corners of each of the tetrahedra `bad` that may move, all at once, to where the worst
/// tetrahedron around any of them is better. As move_vertices otherwise, with `tried` by tetrahedron; patches
/// whose stars do not reach each other's corners are moved at once. Returns how many patches moved.
std::uint64_t move_patches(TetStore& store, const std::vector<std::uint32_t>& bad,
                           const SurfaceProjection& onto_surface, std::vector<std::uint32_t>& tried,
                           std::uint32_t& epoch);

}  // namespace vdbgeo
