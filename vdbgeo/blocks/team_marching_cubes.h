// Marching cubes of a grid that a team shares out.
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/stencil/share.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/surface_parts.h"

namespace vdbgeo {

/// What a member has of a surface.
struct TeamSurface {
    std::uint64_t vertices = 0, triangles = 0;  ///< of the whole mesh
    SurfacePiece piece;                         ///< what begins in this member's box
    std::uint64_t bytes_sent = 0;               ///< to other members, of the blocks at the borders
};

/// The surface of marching_cubes in parts: with every member's runs put where they belong, the mesh has the
/// same bytes as that of the whole map.
///
/// `part` has the frame of the whole map and, in its grid, the leaves and tiles of the member's box and of 8
/// voxels around it (`part_of(grid, share.with_ghosts(rank))`). The boxes are those of a partition, and what
/// differs from the background lies in them; blocks beyond them, where the surface turns round the outermost
/// leaves, belong to the members whose boxes end there. An empty part is fine.
///
/// Cost: that of marching_cubes for the part. All members learn of all columns of blocks that the surface
/// crosses (20 bytes for 8 × 8 × 128 voxels), and of the crossed blocks along its upper borders a member
/// learns the edges (304 bytes each). Throws what marching_cubes throws, and InvalidInput for a share whose
/// halo is narrower than 8 voxels; all members do.
TeamSurface team_marching_cubes(const DensityMap& part, const MarchingCubesOptions& options,
                                const stencil::Share& share, const Progress& progress = {});

}  // namespace vdbgeo
