// Isotropic and curvature-adaptive remeshing on half-edges.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Edge lengths that follow the curvature: L = √(6 ε/κ − 3 ε²) for a chord error ε, within [min, max]
/// (Dunyach et al. 2013, doi:10.2312/conf/EG2013/short/029-032).
struct CurvatureSizing {
    double min_length = 0;  ///< Å
    double max_length = 0;  ///< Å
    double error = 0;       ///< Å, of a chord against the surface
};

struct IsotropicRemeshOptions {
    /// Å. Unset: the mean edge length of the input.
    std::optional<double> target_length;
    /// Where set: lengths follow the curvature, and target_length is not used.
    std::optional<CurvatureSizing> adaptive;
    /// 0 gives the input back.
    int iterations = 10;
    /// Edges whose faces turn by more are kept as creases; unset: none are. Borders and the rims of caps are
    /// always kept, and so are edges within caps that turn by more than 45°.
    std::optional<double> feature_angle_deg;

    void check() const;
};

/// Replaces a surface by one of nearly equilateral triangles whose edges have the length asked for, on
/// average to some 3 %, and whose vertices lie on the input. Botsch & Kobbelt 2004
/// (doi:10.1145/1057432.1057457): each iteration splits edges above 4/3 of their length, collapses those
/// below 4/5, flips edges towards six a vertex (in the second half: towards larger least angles), moves
/// vertices towards the centres of their faces within the tangent plane, and puts them back onto the input by
/// walking downhill on it, so that a sheet is never mistaken for another one near it. The few faces that
/// still have an angle below 33° are then worked on one by one.
///
/// Takes any manifold mesh, open or closed; it keeps every piece, its genus and its borders. No face turns
/// over in a change; sheets that come nearer to each other than a chord's error may still meet. Pieces too
/// small for the length get shorter edges, some 60 faces each; needles and flakes among them are only
/// improved: drop dust first. Vertex properties are interpolated; the face property `cap_property` is carried
/// from face to face, others are taken from the input below each face's centre. Unused vertices are left out.
///
/// Throws InvalidInput for options that check() refuses, a mesh that check(mesh) refuses or that is no
/// manifold (the message counts the faces), and lengths that ask for more than 3e8 faces. The result has the
/// same bytes for any number of threads. Cost: O(iterations · faces); 150,000 faces to 67,000 take 0.5 s of
/// one CPU.
TriMesh isotropic_remesh(const TriMesh& mesh, const IsotropicRemeshOptions& options = {},
                         const Progress& progress = {});

}  // namespace vdbgeo
