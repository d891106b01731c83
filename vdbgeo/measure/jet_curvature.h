// Curvature from a polynomial fitted to the surface around each vertex.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

struct JetOptions {
    int degree = 2;                ///< 2, 3 or 4
    int rings = 2;                 ///< the vertices within this many edges are fitted; 1 to 64
    std::optional<double> radius;  ///< in place of rings: those within this straight distance, Å
    /// Throws InvalidInput unless the above holds and the radius is finite and above 0.
    void check() const;
};

/// The jet z = Σ a_ij x^i y^j of a degree over the tangent plane, fitted by least squares with equal weights
/// to the vertices around, and its curvature at the vertex (Cazals & Pouget 2005,
/// doi:10.1016/j.cagd.2004.09.004). The plane is that of the area-weighted normal; the vertex itself is one
/// of the points and not held fast. On noise-free vertices a distance h apart the error of the curvatures is
/// of order h^(degree − 1), and one order better for even degrees where the vertices lie evenly around.
///
/// Takes any mesh; caps are left out, borders are fitted from their one side. Where the points do not
/// determine the jet (too few, or on a conic) a lower degree is taken, and where there is no jet of degree 2
/// the neighbourhood grows by up to three rings of edges; after that the vertex is undefined. Throws
/// InvalidInput as curvature_flags does. Time is linear in the vertices and in the points of a
/// neighbourhood; about 60 bytes a face.
Curvatures jet_curvature(const TriMesh& mesh, const JetOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
