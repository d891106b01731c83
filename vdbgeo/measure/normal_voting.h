// Curvature by normal voting, PyCurv's way.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

struct NormalVotingOptions {
    std::optional<double> radius;  ///< Å (PyCurv's radius_hit), about that of the smallest feature of
                                   ///< interest; none: 5 mean edges
    void check() const;
};

/// Normals, and then curvature, by votes of the neighbourhood: augmented vector voting (AVV) of PyCurv
/// (Salfer, Collado, Baumeister, Fernández-Busnadiego, Martínez-Sánchez 2020,
/// doi:10.1371/journal.pcbi.1007962), after Page et al. 2002 (doi:10.1006/gmod.2002.0574) and Tong & Tang
/// 2005 (doi:10.1109/TPAMI.2005.62). For each vertex v:
///
/// 1. Every face whose middle c is within g = π radius / 2 of v along the surface votes for the normal that
///    an arc from v to c would have at v: n' = n − 2 (n·u) u, u = (c − v)/|c − v|. The voted normal n_v is
///    the eigenvector of the largest eigenvalue of Σ w n' n'ᵀ, w = face's area · exp(−3 distance / g), on
///    the side of the faces' own normals.
/// 2. Every vertex x within g votes for the normal curvature in its direction t, the part of x − v
///    perpendicular to n_v: κ = 2 sin(φ/2) / |x − v|, φ the angle from n_v to n_x within the plane of n_v
///    and t, positive where n_x leans away from v. With b1 ≥ b2 the tangent eigenvalues of
///    Σ w κ t tᵀ / Σ w, w = a third of the area of the faces at x · exp(−3 distance / g):
///    k1 = 3 b1 − b2, k2 = 3 b2 − b1, directions the eigenvectors.
///
/// Other than PyCurv, which works at the middles of faces, this works at the vertices, and distances run
/// across faces (GeodesicDisc), not from middle to middle. PyCurv wants normals that point inward: given a
/// surface whose normals point outward, it turns every sign, and its kappa_1 is −k2 here. It can leave out
/// what is nearer than g to a border; here a border vertex takes the votes of its one side and is flagged.
/// Exact on a sphere if its voted normals are; what is smaller than the radius is smoothed away.
///
/// Any mesh that `curvature_flags` takes; caps have no vote. Undefined too where nothing else is within g.
/// Throws what `curvature_flags` throws, InvalidInput for a radius that is not positive, and Cancelled.
///
/// Cost: proportional to the vertices within g, 0.5 µs for each; at the default radius 0.12 ms a vertex on
/// one thread. 56 bytes a face above the mesh and the result, and 10 for each thread. The same bytes for any
/// number of threads.
Curvatures voted_curvature(const TriMesh& mesh, const NormalVotingOptions& options = {},
                           const Progress& progress = {});

}  // namespace vdbgeo
