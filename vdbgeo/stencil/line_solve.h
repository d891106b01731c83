// Implicit steps along lines: banded solves in the runs of active voxels of every line of an axis.
#pragma once

#include <vector>

#include "vdbgeo/core/types.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"
#include "vdbgeo/stencil/diffusion_sweep.h"

namespace vdbgeo::stencil {

/// v := (I + c Σ_q L_{d_q,a} L_a^q)^{-1} v for the axes a = x, y, z in turn, where L_a and L_{d,a} are the
/// parts of L and L_d along one axis, weight w_a included, under the band-edge rule. Elimination without
/// pivoting in double: the matrices have positive spectra. c ≥ 0; 0 leaves v as it is. Orders up to 15.
/// Bitwise the same for any number of threads. Cost: O((q+1)²) a voxel and axis.
void solve_lines(const BlockLayout& layout, const std::vector<SweepTerm>& terms, const Vec3d& weights,
                 double c, float* v);

}  // namespace vdbgeo::stencil
