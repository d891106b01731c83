// Closes the surface of a map where it meets the border of the box.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The surface that marching_cubes gave for `map` at `isovalue`, with flat caps on the six border planes of
/// the box: the parts of the planes where the bilinear interpolant is at or above the isovalue, a polygon in
/// each square of four samples, its saddles settled by the asymptotic decider as in the cells. Closed then,
/// oriented, and a manifold with the map's dense part inside. Caps share the vertices of the open border and
/// have one more at each border sample inside; the face property `cap_property` is 1 on them and 0 elsewhere.
/// Other properties become 0 there.
///
/// A map that is dense everywhere becomes the box of its samples; an unbounded grid's surface is closed as it
/// is. Cost: in proportion to the border of the box. Throws InvalidInput for an isovalue that is not finite,
/// for a mesh whose border is not that of this map at this isovalue (or is lost in rounding: coordinates 10^5
/// times the voxel), for one that has caps, and for 2^32 vertices or more; Cancelled.
TriMesh cap_border(TriMesh mesh, const DensityMap& map, double isovalue, const Progress& progress = {});

}  // namespace vdbgeo
