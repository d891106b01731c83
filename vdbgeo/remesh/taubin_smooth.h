// Smoothing without shrinking: Taubin's λ|μ filter.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Taubin 1995 (doi:10.1145/218380.218473).
struct TaubinOptions {
    int iterations = 10;     ///< pairs of a shrinking and a growing step; 0 gives the input back
    double lambda = 0.5;     ///< the shrinking step, above 0 and up to 1
    double pass_band = 0.1;  ///< k_PB = 1/λ + 1/μ, above 0 and below 1/λ: what varies more slowly stays

    /// Throws InvalidInput outside these ranges, and where the pair of steps would make the fastest waves
    /// grow:
    /// |(1 − 2λ)(1 − 2μ)| > 1.
    void check() const;
};

/// x ← x + λ Δx, then x ← x + μ Δx with μ = 1/(k_PB − 1/λ) < 0, where Δx is the mean of the neighbours less
/// x. The weights are uniform: only then do the frequencies lie between 0 and 2 whatever the triangles, and
/// the filter (1 − λk)(1 − μk) grows nothing outside of its pass band; cotangents are unbounded, and
/// negative, on the thin triangles that marching cubes leaves. Uniform weights also move vertices along the
/// surface, which rounds the triangles. All vertices of a step move at once: the same bytes for any number of
/// threads.
///
/// Any mesh, closed or open. Vertices on borders, on edges of more than two faces and on the rims of caps
/// stay. Connectivity and properties are untouched. Throws InvalidInput for a mesh that `check` refuses;
/// Cancelled. A few nanoseconds a neighbour and step; 120 bytes a vertex.
TriMesh taubin_smooth(const TriMesh& mesh, const TaubinOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
