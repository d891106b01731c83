// Curvature from angles and cotangents of the faces around each vertex.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

/// The area of the dual cell of a vertex. Each kind adds up to the area of the mesh.
enum class DualArea {
    barycentric,  ///< a third of the faces' areas
    voronoi,  ///< Eq 14: Σ (cot α + cot β) |e|² / 8; the best, the paper finds. Obtuse faces can make it
              ///< small and even negative: K and H follow, as the formulas stand
    mixed,    ///< Voronoi's in acute faces, half or a quarter of the face in obtuse ones (Meyer et al. 2003,
              ///< doi:10.1007/978-3-662-05105-4_2); always positive
};

struct DiscreteCurvatureOptions {
    DualArea area = DualArea::mixed;
};

struct DiscreteCurvature : Curvatures {
    Array<double> dual_area;  ///< Å²; 0 where no face with an area is
};

/// K by the angle defect and H by the cotangent Laplacian (Feng, Xia, Tong, Wei 2012, Eqs 13 to 15,
/// doi:10.1002/cnm.2532; Meyer et al. 2003): with θ the faces' angles at a vertex, α and β the angles that
/// face an edge, A the dual area,
///     K = (2π − Σ θ) / A,   H n = Σ (cot α + cot β) (v − w) / (4 A),
/// H signed by the area-weighted outward normal. k1 and k2 from H ± √max(0, H² − K); no directions.
/// Σ K A = 2π χ to rounding, over what is not cap. On borders π stands for 2π, which keeps that sum: K there
/// holds the border's own bend, and H is the part along the normal of a Laplacian that is seen from one side.
/// Both are flagged, and neither is worth much.
///
/// One-ring formulas are exact in the limit of fine, regular meshes. On surfaces cut from voxels they err by
/// tens of percent and more, because the rounding of one edge is as large as its bend: take another method.
///
/// Any mesh that `curvature_flags` takes; open, with caps, with several parts. A face without area counts
/// with the angles of the limit (π at the middle one of three points in a row; π/2 and π/2 where two
/// coincide; π/3 each where all do) and adds nothing to H and A. Undefined vertices: as `curvature_flags`,
/// and where A is 0. Throws what `curvature_flags` throws, and Cancelled.
///
/// Cost: O(n), 65 to 85 ns a face on one thread (10^5 to 10^7 faces); 60 bytes a face with the mesh (18)
/// and the result (20.5). The same bytes for any number of threads.
DiscreteCurvature discrete_curvature(const TriMesh& mesh, const DiscreteCurvatureOptions& options = {},
                                     const Progress& progress = {});

}  // namespace vdbgeo
