// How much noise is in a map.
#pragma once

#include <openvdb/openvdb.h>

namespace vdbgeo {

/// Standard deviation of white noise, robustly: 1.4826 times the median absolute value of L u over the active
/// voxels whose six neighbours are active, over √42 (the norm of the 7-point stencil; Immerkær 1996 in two
/// dimensions). Structure adds little to the median as long as most voxels are smooth. Voxels where L u is 0
/// exactly, such as a solvent that was masked, are left out. 0 where none is left. Noise that is correlated
/// between voxels is underestimated.
double estimate_noise(const openvdb::FloatGrid& grid);

/// Robust standard deviation of the density: 1.4826 times the median absolute deviation from the median, over the
/// active voxels. Where most of a map is solvent, this is its noise, correlated or not.
double density_spread(const openvdb::FloatGrid& grid);

/// What a denoiser is to remove, as a root mean square. White noise: estimate_noise. Where the spread of the
/// density is over 1.5 times that, the noise of neighbouring voxels is correlated, as in maps that were resampled
/// or filtered; then it is the lesser of 0.85 times the spread, as a part of such noise has the size of the
/// structure, and of 2.5 times the white noise, as the spread may be the structure's own.
double removable_noise(const openvdb::FloatGrid& grid);

}  // namespace vdbgeo
