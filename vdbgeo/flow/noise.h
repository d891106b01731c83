// How much noise is in a map.
#pragma once

#include <openvdb/openvdb.h>

namespace vdbgeo {

/// Standard deviation of white noise, robustly: 1.4826 times the median absolute value of L u over the active
/// voxels whose six neighbours are active, over √42 (the norm of the 7-point stencil; Immerkær 1996 in two
/// dimensions). Structure adds little to the median as long as most voxels are smooth. 0 where no voxel has
/// all its neighbours. Noise that is correlated between voxels is underestimated.
double estimate_noise(const openvdb::FloatGrid& grid);

}  // namespace vdbgeo
