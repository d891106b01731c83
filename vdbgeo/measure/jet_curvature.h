// Curvature from a polynomial fitted to the surface around each vertex.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

struct JetOptions {
    int degree = 2;                ///< 2, 3 or 4
    int rings = 2;                 ///< the vertices within this many edges are fitted
    std::optional<double> radius;  ///< in place of rings: those within this straight distance, Å
    void check() const;
};

/// The jet z = Σ a_ij x^i y^j of a degree over the tangent plane, fitted by least squares, and its curvature
/// at the vertex (Cazals & Pouget 2005, doi:10.1016/j.cagd.2004.09.004).
Curvatures jet_curvature(const TriMesh& mesh, const JetOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
