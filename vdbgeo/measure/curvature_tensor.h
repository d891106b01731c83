// The curvature tensor averaged over a neighbourhood of each vertex.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

enum class TensorNeighbourhood {
    ring,      ///< the faces at the vertex
    ball,      ///< what of the surface is within a straight distance and joined to the vertex in there
    geodesic,  ///< what is within a distance along the surface
};

struct CurvatureTensorOptions {
    TensorNeighbourhood neighbourhood = TensorNeighbourhood::ball;
    std::optional<double> radius;  ///< Å; none: 3 mean edges. Not for rings.
    void check() const;
};

/// C = 1/A Σ β(e) l(e) e eᵀ over the edges' parts within the neighbourhood (Eq 16; Cohen-Steiner & Morvan
/// 2003). The direction of k1 is the eigenvector of the other tangent eigenvalue: edges bend across
/// themselves.
Curvatures tensor_curvature(const TriMesh& mesh, const CurvatureTensorOptions& options = {},
                            const Progress& progress = {});

}  // namespace vdbgeo
