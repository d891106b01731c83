// Fits over wide neighbourhoods, at as few vertices as do.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"
#include "vdbgeo/measure/fit_scale.h"

namespace vdbgeo {

/// Whether neighbourhoods are so wide, 9.6 spacings or more, that those next to each other hardly differ.
bool is_wide(const ScaledFits& fits, const FitScale& scale);

/// Fits at anchors no more than r/8 from every vertex of the surface, r the radius of the neighbourhoods, and
/// gives each vertex the mean of the shape operators of the anchors within r/4, turned into its tangent
/// plane, weighted by (1 − 16 d²/r²)² and the cosine between normals. What varies within r/4 is lost in a fit
/// over r as it is. Deterministic: anchors are taken in the order of the vertices.
void fit_by_anchors(const ScaledFits& fits, const FitScale& scale, Curvatures& out, const Progress& progress);

}  // namespace vdbgeo
