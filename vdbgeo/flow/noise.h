// How much noise is in a map.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>

#include "vdbgeo/stencil/share.h"

namespace vdbgeo {

/// Standard deviation of white noise, robustly: 1.4826 times the median absolute value of the 7-point stencil
/// 6 u − Σ u over neighbours `spacing` voxels away (1…8), over √42, its norm (Immerkær 1996 in two
/// dimensions). Over the active voxels whose six neighbours are active; those where it is 0 exactly, such as
/// a solvent that was masked, are left out. 0 where none is left. Structure adds little to the median as long
/// as most voxels are smooth. With spacing 1 noise that is correlated between voxels is underestimated. A
/// sample of a large grid's voxels, 8 million, stands for all. `share`: the grid is one member's part, with a
/// halo of at least `spacing`; the number is that of all parts.
double estimate_noise(const openvdb::FloatGrid& grid, int spacing = 1, const stencil::Share* share = nullptr);

/// What a denoiser is to remove, as a root mean square: estimate_noise with spacing 2, where spacing 4 gives
/// no more than 1.3 times as much; that is so for noise, white or correlated over a few voxels as in maps
/// that were resampled or filtered. Structure differs ever more with the distance: where it shows, spacing 1.
double removable_noise(const openvdb::FloatGrid& grid, const stencil::Share* share = nullptr);

/// The same of a map of so many active voxels, from its sample alone: `sample` has the leaves of the cells of
/// 32 × 32 × 128 voxels for which in_noise_sample, given their first voxel, is true, and all around them.
double removable_noise_of_sample(const openvdb::FloatGrid& sample, std::uint64_t active_voxels);
bool in_noise_sample(const openvdb::Coord& cell, std::uint64_t active_voxels);

}  // namespace vdbgeo
