// Speeds of surfaces on a narrow band, and the implicit step of the flows of fourth order.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/flow/level_set_band.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo {

/// |∇φ| div(∇φ/|∇φ|) by central differences of second order where φ's 3³ neighbours are in the band;
/// elsewhere the value at the nearest point of the surface.
stencil::BlockField mean_curvature_rate(const SurfaceBand& band);

/// V = Δ_s κ, κ = k1 + k2, the same along a normal. Δ_s is the Laplacian of what is constant along normals
/// (closest point method, Ruuth & Merriman 2008).
stencil::BlockField surface_diffusion_speed(const SurfaceBand& band);

/// V = Δ_s H + 2 H (H² − K), H = (k1 + k2)/2: minus the gradient of ∫H². The same along a normal.
stencil::BlockField willmore_speed(const SurfaceBand& band);

/// (I + a L²) δ = right side, L with the band-edge rule, by conjugate gradients from δ = right side, until
/// the residual's norm is `tolerance` of the right side's or its root mean square `small`; the error of δ is
/// not larger. Returns the number of iterations. Sums have a fixed order. Throws NumericalError where it does
/// not get there.
int solve_biharmonic(const stencil::BlockLayout& layout, double a, const stencil::BlockField& right_side,
                     double tolerance, double small, stencil::BlockField& delta);

/// Largest absolute value of a field (infinite where a value is not finite).
double largest(const stencil::BlockField& field);

}  // namespace vdbgeo
