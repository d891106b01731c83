// What commands share that make a map out of a map when a team runs them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/map_filter.h"
#include "vdbgeo/stencil/share.h"
#include "vdbgeo/volume/map_statistics.h"

namespace vdbgeo::app {

/// One member's part of a map.
struct MapOfTeam {
    MapFile in;  ///< own leaves and ghosts; what is told of the map is told of the whole
    stencil::Share share;
};

/// Shares out the map among the session's team and reads this member's part, with ghosts `halo` voxels wide.
/// Says what is odd about it. `box_only` as in MapPart.
MapOfTeam read_for_team(const std::string& in, const MapReadOptions& options, int halo, bool box_only,
                        Session& session);

/// A map that is to become another: whole, or a member's part where a team runs the command.
struct FilterInput {
    MapFile in;
    std::optional<stencil::Share> part;

    const stencil::Share* share() const { return part ? &*part : nullptr; }
    /// Which leaves count, for statistics.
    MapShare counted() const { return part ? MapShare{part->team, part->own()} : MapShare{}; }
};

/// read_for_filter, or this member's part with ghosts `halo` voxels wide and the same checks but that of the
/// memory.
FilterInput read_filter_input(const MapFilterFlags& flags, const MemoryNeed& need, int halo,
                              Session& session);

/// Makes the statistics, the metadata and the history of the map those of its new values, of all parts.
void finish_map(FilterInput& input, const std::string& history);

/// write_filtered, or by all members. Adds how many there are, and what they sent each other, to the result.
void write_filtered(const MapFilterFlags& flags, const FilterInput& input, std::uint64_t bytes_sent,
                    Json& result, Session& session);

/// UsageError, or IoError for its folder, where a team cannot write such a file. A name that ends in .parts
/// is a folder of parts, which stay apart.
void check_team_output(const MapFilterFlags& flags, Session& session);

/// Makes one file of a folder of parts, by its name's ending. What there is to say of an MRC file comes back.
std::optional<MrcWriteReport> merge_parts(const std::filesystem::path& folder, const std::string& out,
                                          const MapReadOptions& read, const VdbWriteOptions& vdb,
                                          const MrcWriteOptions& mrc, const Progress& progress);

}  // namespace vdbgeo::app
