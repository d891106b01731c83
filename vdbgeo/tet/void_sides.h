// The parts of a surface that bound the same empty space.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Parts the faces whose front is empty (one flag a face) into those that are connected through the empty
/// space next to them: across an edge of two such faces, and at edges of more faces, where solids meet,
/// between faces that look at each other. Gives for each part its faces in ascending order, the parts by
/// their first faces. Cost: O(n log n).
std::vector<std::vector<std::uint32_t>> void_sides(const TriMesh& mesh,
                                                   const std::vector<bool>& empty_before);

}  // namespace vdbgeo
