// Grids for Blender, Houdini and their like: which ones, at which levels, placed where.
#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/session.h"
#include "converters/map_file.h"
#include "converters/vdb_file.h"
#include "vdbgeo/volume/fog.h"
#include "vdbgeo/volume/placement.h"

namespace vdbgeo::app {

/// The flags that make a scene of a map. Without any of them a map is converted as it is.
struct SceneFlags {
    // What the command line says.
    std::string program, grid_names, iso = "auto", fog;
    std::optional<double> units_per_A;
    bool centre = false;
    std::vector<std::string> additions;

    void add(CLI::App& app);
    /// Turns texts into the fields below; throws UsageError.
    void finish();
    /// Whether any flag was given that asks for more than the raw map.
    bool wanted() const {
        return !program.empty() || !grid_names.empty() || !fog.empty() || !additions.empty();
    }

    // What that means, after finish().
    std::optional<PlacementOptions> placement;  ///< unset: in Å, where the map is
    std::vector<std::string> grids;  ///< of density, surface, gradient, mean_curvature; may be empty
    Isovalue isovalue;
    std::optional<FogOptions> fog_options;
    std::vector<std::pair<std::string, std::string>> added;  ///< name and file
};

/// What the frames of an animation share, so that it does not flicker or jump: the first frame sets what is
/// not given.
struct SceneLevels {
    std::optional<FogRange> fog;
    std::optional<double> isovalue;
    std::optional<Vec3d> centre_A;
};

/// The grids of a scene from the map, in Å, that was read from `file`. Warnings go to the session. Errors as
/// those of the steps, with the file's name before them.
std::vector<openvdb::GridBase::ConstPtr> scene_grids(const std::string& file, const MapFile& in,
                                                     const SceneFlags& flags, SceneLevels& levels,
                                                     Session& session);

/// Writes grids as .vdb or .nvdb, by the name's ending.
void write_grids(const std::vector<openvdb::GridBase::ConstPtr>& grids, const std::string& path,
                 const VdbWriteOptions& vdb, const Progress& progress);

/// The grids and levels as stable JSON keys: grids[] (name, class, active_voxels), and where they are set
/// fog[low, high], iso, for, units_per_A.
Json scene_json(const std::vector<openvdb::GridBase::ConstPtr>& grids, const SceneFlags& flags,
                const SceneLevels& levels);

/// "out.vdb" → "out_0001.vdb": what Blender and Houdini take for a sequence.
std::string numbered(const std::string& path, int number);

}  // namespace vdbgeo::app
