// Curvature by normal voting, PyCurv's way.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

struct NormalVotingOptions {
    std::optional<double> radius;  ///< geodesic, Å (PyCurv's radius_hit); none: 5 mean edges
    void check() const;
};

/// Normals and then curvature from votes of all vertices within a geodesic radius, weighted by area and
/// distance (Page et al. 2002; Tong & Tang 2005; augmented vector voting of Salfer et al. 2020,
/// doi:10.1371/journal.pcbi.1007962).
Curvatures voted_curvature(const TriMesh& mesh, const NormalVotingOptions& options = {},
                           const Progress& progress = {});

}  // namespace vdbgeo
