// Closes the surface of a map where it meets the border of the box.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The surface that marching_cubes gave for `map` at `isovalue`, with flat caps on the six border planes of the
/// box: the parts of the planes where the bilinear interpolant is at or above the isovalue. Closed then, a
/// manifold wherever the surface was one. Caps share the vertices of the open border, and the face property
/// `cap_property` is 1 on them and 0 elsewhere.
TriMesh cap_border(TriMesh mesh, const DensityMap& map, double isovalue, const Progress& progress = {});

}  // namespace vdbgeo
