// The parts of a repair that join, drop and turn faces.
#pragma once

#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Open edges (of one face) whose both ends lie bit for bit where those of another open edge lie become one
/// edge: a soup of triangles becomes a surface, and surfaces that touch elsewhere stay apart. The lowest
/// vertex of each place is kept. Returns how many vertices went out of use.
std::uint64_t merge_open_edges(TriMesh& mesh);

/// Takes out faces on the same three vertices as another. Of faces that are turned alike the first stays. Of
/// two that are turned opposite ways none does, unless each side would be an open edge then: the first stays
/// there. Returns how many went.
std::uint64_t remove_duplicate_faces(TriMesh& mesh);

}  // namespace vdbgeo
