// Curvature from angles and cotangents of the faces around each vertex.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

/// The area of the dual cell of a vertex.
enum class DualArea {
    barycentric,  ///< a third of the faces' areas
    voronoi,      ///< Eq 14: Σ (cot α + cot β) |e|² / 8; the best, the paper finds
    mixed,  ///< Voronoi's in acute faces, half or a quarter of the face in obtuse ones (Meyer et al. 2003)
};

struct DiscreteCurvatureOptions {
    DualArea area = DualArea::mixed;
};

struct DiscreteCurvature : Curvatures {
    Array<double> dual_area;  ///< Å²
};

/// K by the angle defect (Eq 13; π in place of 2π on borders) and H by the cotangent Laplacian (Eq 15) signed
/// by the area-weighted outward normal. Σ K A = 2π χ over a closed mesh, to rounding.
DiscreteCurvature discrete_curvature(const TriMesh& mesh, const DiscreteCurvatureOptions& options = {},
                                     const Progress& progress = {});

}  // namespace vdbgeo
