// Parts of a mesh, with their properties.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The given faces and the vertices that they use; both in the order of the mesh if `faces` rises.
TriMesh pick_faces(const TriMesh& mesh, const std::vector<std::uint32_t>& faces);

/// Takes out the faces that have a flag; vertices stay. Returns how many went.
std::uint64_t remove_faces(TriMesh& mesh, const std::vector<bool>& flags);

/// Takes out the vertices that no face uses. Returns how many.
std::uint64_t remove_unused_vertices(TriMesh& mesh);

}  // namespace vdbgeo
