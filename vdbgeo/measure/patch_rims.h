// The rims of patches of a mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct PatchRim {
    /// Closed lines around the patch that matter: 0 for a whole closed surface, 1 for a bowl, 2 for a tube.
    /// Those that span less than a twentieth of what the largest does are pinholes.
    std::uint32_t loops = 0;
    double length_A = 0;             ///< of these
    Vec3d mouth_A2 = Vec3d::Zero();  ///< area vector ½ Σ p × q of the loop that spans most
};

/// The rims of patches 1 … count, `patch` of each vertex (0: none). A rim cuts the edges that leave its
/// patch: where `excess` changes sign, not above 0 at the inner end and above it at the outer one, at its
/// zero between them; in the middle of the others. Loops run counter-clockwise as the patch is seen from
/// outside, so that the area vector is that of any surface spanned by the loop, out of the mouth of a pit.
/// Lines that end at a border of the mesh are closed by a straight one. Caps are no faces. Cost: O(n), and
/// O(r log r) for r cut edges.
std::vector<PatchRim> patch_rims(const TriMesh& mesh, const Array<std::uint32_t>& patch, std::uint32_t count,
                                 const Array<double>& excess);

}  // namespace vdbgeo
