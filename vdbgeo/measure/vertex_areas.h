// Each vertex's share of a surface.
#pragma once

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// A third of the areas of the faces at each vertex, caps (cap_property) left out, in Å²: they sum to the
/// area of the surface. 0 where a vertex has no face. Throws InvalidInput for a mesh that check() refuses.
/// Cost: O(n), 8 bytes a face for a moment.
Array<double> vertex_areas(const TriMesh& mesh);

}  // namespace vdbgeo
