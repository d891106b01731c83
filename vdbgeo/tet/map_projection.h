// Back onto the isosurface of a map.
#pragma once

#include "vdbgeo/tet/tet_optimize.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The boundary of where the trilinear interpolant of the map is at or above `isovalue` (TrilinearField), to
/// which isosurface_stuffing and marching_cubes mesh: the isosurface, and the border of the map's box where
/// the inside reaches it.
///
/// From x the isosurface is looked for along the interpolant's gradient in the world, within one voxel (the
/// smallest voxel step), and its place found to 1e-12 of it. What is on the border of the box, or was moved
/// out of it by up to a voxel, stays on the border; of the border and the isosurface the nearer one is taken.
/// Nothing where both are farther than a voxel, where the gradient is no direction, and for x that is not
/// finite.
///
/// The map's grid has to stay as it is while the projection is used. Throws InvalidInput for an isovalue that
/// is not finite. Cost: about 0.5 µs a call.
SurfaceProjection map_projection(const DensityMap& map, double isovalue);

}  // namespace vdbgeo
