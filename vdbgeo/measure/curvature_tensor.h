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

/// The average over a neighbourhood of the tensor that the bends of the edges make (Feng, Xia, Tong, Wei
/// 2012, Eq 16, doi:10.1002/cnm.2532; Cohen-Steiner & Morvan 2003, doi:10.1145/777792.777839):
///     C = 1/A Σ β(e) l(e) e eᵀ,
/// β the angle between the normals of an edge's two faces, positive where they bend away from the outward
/// normal, e its unit direction, l its length within the neighbourhood, A the neighbourhood's area. k1 and k2
/// are the eigenvalues of C within the plane perpendicular to the neighbourhood's mean normal — the third
/// eigenvalue is nearly 0, but so may k2 be, and then the eigenvectors alone do not tell the normal. The
/// direction of k1 is the eigenvector of the other tangent eigenvalue: edges bend across themselves.
///
/// - ring: the edges at the vertex, and half of those around it.
/// - ball: the edges are cut by the sphere, the faces by the circle in which it meets their plane; exact.
/// - geodesic: distances run across the faces (GeodesicDisc); along an edge and over a face they are
///   interpolated linearly, which makes the area wrong by about (edge / (2 radius))² of itself, 3 % at the
///   default.
///
/// Averaging makes k smaller on what bends within the radius: by (radius / 2 R)² of itself on a sphere of radius R.
/// Faces without area have the normal of their neighbour across the longest edge. Caps are left out; at a
/// border the neighbourhood is what is there. Any mesh that `curvature_flags` takes. Throws what that throws,
/// InvalidInput for a radius that is not positive, and Cancelled.
///
/// Cost: at the default radius about 6 µs a vertex for the ball; 60 bytes a face above the mesh and the
/// result, and 4 more for each thread. The same bytes for any number of threads.
Curvatures tensor_curvature(const TriMesh& mesh, const CurvatureTensorOptions& options = {},
                            const Progress& progress = {});

}  // namespace vdbgeo
