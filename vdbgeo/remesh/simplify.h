// Fewer faces by quadric edge collapses.
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// At least one of the two; with both, whichever is reached first ends it.
struct SimplifyOptions {
    std::optional<std::uint64_t> faces;   ///< stop at this many faces
    std::optional<double> max_distance;   ///< Å: two-sided Hausdorff distance to the input stays within it

    void check() const;
};

/// Garland & Heckbert 1997 (doi:10.1145/258734.258849).
TriMesh simplify(const TriMesh& mesh, const SimplifyOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
