// Makes the faces of each piece agree, and closed pieces face outward.
#pragma once

#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Turns faces until those at each edge of two run through it in opposite directions. In each patch that is
/// connected through such edges the fewer are turned; of equally many those that are not like its first face.
/// Returns how many were turned. Throws InvalidInput for a patch with one side only (a Moebius band, a Klein
/// bottle), naming a face.
std::uint64_t orient_patches(TriMesh& mesh);

struct OutwardCounts {
    std::uint64_t pieces = 0, faces = 0;
};

/// Turns closed pieces of negative volume over, unless they are cavities: those that an odd number of closed
/// pieces is around, or the solid side of an open one. What a piece that is turned holds is turned with it
/// where that makes a cavity of it. Returns what was turned. The mesh must be a manifold.
OutwardCounts turn_outward(TriMesh& mesh);

}  // namespace vdbgeo
