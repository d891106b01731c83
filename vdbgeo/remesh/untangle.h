// Tries to remove self-intersections.
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct Untangled {
    std::uint64_t before = 0, after = 0;  ///< faces that cut another
    std::uint64_t moved_vertices = 0;
    std::uint64_t refilled_faces = 0;  ///< taken out
    std::uint64_t added_faces = 0;     ///< in their place
};

/// Smooths the vertices of faces that cut others of their own piece, or touch others in a vertex at the same
/// place (as sheets do that were taken apart): a step to the mean of their neighbours, small at first, then
/// half way, in growing surroundings. Where faces still cut each other, they are taken out with all faces
/// around them and the holes are filled, as long as the number of pieces and of open holes stays. This is
/// done up to three times. Of all states the one in which the fewest faces cut each other stays, and of
/// equals the first. Borders, caps and their rims are not touched.
///
/// The mesh must be an oriented manifold, and this build must have_self_intersections().
Untangled untangle(TriMesh& mesh, std::uint64_t max_hole_edges, const Progress& progress = {});

}  // namespace vdbgeo
