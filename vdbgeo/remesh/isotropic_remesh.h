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
    int iterations = 10;
    /// Edges whose faces turn by more are kept as creases; unset: none are. Borders and the rims of caps are
    /// always kept.
    std::optional<double> feature_angle_deg;

    void check() const;
};

TriMesh isotropic_remesh(const TriMesh& mesh, const IsotropicRemeshOptions& options = {},
                         const Progress& progress = {});

}  // namespace vdbgeo
