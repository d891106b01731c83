// What commands share that make a map out of a map when a team runs them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/map_filter.h"
#include "vdbgeo/stencil/share.h"

namespace vdbgeo::app {

/// One member's part of a map.
struct MapOfTeam {
    MapFile in;  ///< own leaves and ghosts; what is told of the map is told of the whole
    stencil::Share share;
};

/// Shares out the map among the session's team and reads this member's part, with ghosts `halo` voxels wide.
/// Says what is odd about it.
MapOfTeam read_for_team(const std::string& in, const MapReadOptions& options, int halo, Session& session);
/// The same with the checks of read_for_filter.
MapOfTeam read_for_team(const MapFilterFlags& flags, int halo, Session& session);

/// Returns once all members have come here.
void wait_for_all(Team& team);

/// Makes the statistics, the metadata and the history those of the new values of all parts.
void finish_map(DensityMap& map, const std::string& history, const stencil::Share& share);

/// UsageError where a team cannot write such a file.
void check_team_output(const MapFilterFlags& flags);

/// Every member writes its part into a folder beside the output, and then one of them makes them one file. A
/// name that ends in .parts is such a folder, and stays one.
void write_by_team(const MapFilterFlags& flags, const DensityMap& map, const stencil::Share& share,
                   Json& result, Session& session);

/// Makes one file of a folder of parts, by its name's ending. What there is to say of an MRC file comes back.
std::optional<MrcWriteReport> merge_parts(const std::filesystem::path& folder, const std::string& out,
                                          const MapReadOptions& read, const VdbWriteOptions& vdb,
                                          const MrcWriteOptions& mrc, const Progress& progress);

}  // namespace vdbgeo::app
