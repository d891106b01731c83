// Grids in the scene of a 3D program: its up axis, its units.
#pragma once

#include <optional>
#include <string>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

enum class SceneProgram {
    blender,  ///< z is up, as in a map: x, y, z stay
    houdini   ///< y is up: (x, y, z) → (x, z, -y)
};

const char* name_of(SceneProgram program);

struct PlacementOptions {
    SceneProgram program = SceneProgram::blender;
    /// Scene units (metres, to the programs) per Å. 0.01: 100 Å become 1; above 0, from 1e-6 to 1e6.
    double units_per_A = 0.01;
    /// World position that comes to the scene's origin, Å. The centre of the map's box puts the map there;
    /// zero keeps world coordinates, so that several maps and models keep their places.
    Vec3d centre_A = Vec3d::Zero();

    void check() const;
};

/// World position of the middle of the box, Å: of the samples of a bounded frame, else of the active voxels.
Vec3d centre_of_box(const DensityMap& map);

/// Puts a grid into the scene: p → units · turn · (p - centre). Only the transform changes, never a voxel's
/// index. Values that are lengths or directions go along: a level set's distances are scaled to the scene's
/// units, since programs take them for such, and vectors are turned. Densities, and what is given per Å (the
/// length of the gradient, the mean curvature), keep their numbers.
///
/// Metadata: `vdbgeo_for`, `vdbgeo_units_per_A`, `vdbgeo_centre_A`; the history tells too. Throws
/// InvalidInput for a grid that is placed already, for bad options, and for voxels too small for OpenVDB
/// (3e-15 cubic units).
void place(openvdb::GridBase& grid, const PlacementOptions& options);

/// How a grid was placed; nothing for one that was not.
std::optional<PlacementOptions> placement_of(const openvdb::GridBase& grid);

/// Takes a placed grid back to Å; the transform and the distances to rounding. Nothing happens to others.
void undo_placement(openvdb::GridBase& grid);

}  // namespace vdbgeo
