// The convex hull of a point set.
#pragma once

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The hull's corners and faces, normals outward. Throws InvalidInput where the points have no volume.
TriMesh convex_hull(const Array<Vec3f>& points);

}  // namespace vdbgeo
