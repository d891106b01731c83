// Smoothing without shrinking: Taubin's λ|μ filter.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Taubin 1995 (doi:10.1145/218380.218473).
struct TaubinOptions {
    int iterations = 10;
    double lambda = 0.5;
    double pass_band = 0.1;  ///< k_PB = 1/λ + 1/μ

    void check() const;
};

TriMesh taubin_smooth(const TriMesh& mesh, const TaubinOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
