// Edge lengths that follow the curvature of a surface.
#pragma once

#include <vector>

#include "vdbgeo/remesh/input_surface.h"
#include "vdbgeo/remesh/isotropic_remesh.h"

namespace vdbgeo {

/// L = √(6 ε/κ − 3 ε²) at each vertex, within [min, max], κ the larger |principal curvature|; from vertex to
/// vertex L grows by no more than half of the way between them. κ is that of the linear map from steps in the
/// tangent plane to steps of the normal that fits the vertices within two edges best, of normals that are
/// averaged over two rings first: what a triangulation adds to a normal is gone after that, and so is what
/// bends within an edge. Vertices on lines take the mean of those around them.
std::vector<float> curvature_lengths(const InputSurface& input, const CurvatureSizing& sizing);

}  // namespace vdbgeo
