#include "apps/team_filter.h"

#include <fmt/format.h>

#include <filesystem>
#include <functional>

#include "apps/map_output.h"
#include "apps/stages.h"
#include "converters/map_part.h"
#include "converters/map_parts.h"
#include "vdbgeo/blocks/partition.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/run_together.h"
#include "vdbgeo/volume/map_statistics.h"

namespace vdbgeo::app {
namespace {

namespace fs = std::filesystem;

openvdb::CoordBBox box_of(const Frame& frame) {
    return {openvdb::Coord(0), openvdb::Coord(frame.size.x(), frame.size.y(), frame.size.z()).offsetBy(-1)};
}

fs::path folder_of_parts(const std::string& out) {
    return has_ending(out, ".parts") ? fs::path(out) : fs::path(out + ".parts");
}

}  // namespace

MapOfTeam read_for_team(const std::string& in, const MapReadOptions& options, int halo, bool box_only,
                        Session& session) {
    Team& team = *session.team;
    const openvdb::CoordBBox box = box_of(map_frame(in, options));
    MapOfTeam map;
    map.share = {&team, partition(box, parts_for(box, team.size())), halo};
    const MapPart part{&team, map.share.own(), map.share.with_ghosts(team.rank()), box_only};
    map.in = read_map_part(in, options, part, session.stage("reading"));
    for (const std::string& w : map.in.warnings) session.warn(in + ": " + w);
    if (!session.json && !session.quiet)
        for (const std::string& note : map.in.notes) session.say(in + ": " + note);
    return map;
}

FilterInput read_filter_input(const MapFilterFlags& flags, const MemoryNeed& need, int halo,
                              Session& session) {
    if (!session.team) return {read_for_filter(flags, need, session), {}};
    MapOfTeam map = read_for_team(flags.in, flags.map.options, halo, false, session);
    FilterInput input{std::move(map.in), std::move(map.share)};
    need_samples(flags.in, active_moments(*input.in.map.grid, input.counted()), input.in.map.statistics);
    return input;
}

void finish_map(FilterInput& input, const std::string& history) {
    input.in.map.statistics = statistics_of(input.in.map, input.counted());
    note_new_values(input.in.map, history);
}

void check_team_output(const MapFilterFlags& flags, Session& session) {
    if (flags.out == "-") throw UsageError("-: members of a team write files, not to standard output");
    if (has_ending(flags.out, ".nvdb"))
        throw UsageError(fmt::format("{}: a team writes .vdb, map files or a folder .parts", flags.out));
    if (!flags.preview.empty()) throw UsageError("--preview: a team draws no pictures");
    if (!has_ending(flags.out, ".parts")) check_map_output(flags.out, session);
    check_folder_of(flags.out);
}

/// Makes the one file of the parts, and takes them away.
static void write_whole(const MapFilterFlags& flags, const fs::path& folder, const Progress& progress,
                        Json& result, Session& session) {
    const auto report = merge_parts(folder, flags.out, flags.map.options, flags.vdb, flags.mrc, progress);
    session.end_stage();
    if (report) report_written(flags.out, *report, result, session);
    remove_map_parts(folder);
}

/// Every member writes its part into a folder beside the output, and then one of them makes them one file.
/// Where that fails no part is left.
static void write_by_team(const MapFilterFlags& flags, const DensityMap& map, const stencil::Share& share,
                          Json& result, Session& session) {
    Team& team = *share.team;
    const fs::path folder = folder_of_parts(flags.out);
    const Progress progress = session.stage("writing");
    const auto by_the_first = [&](const std::function<void()>& step) {
        run_together(team, [&] {
            if (team.rank() == 0) step();
        });
    };
    by_the_first([&] {
        remove_map_parts(folder);
        std::error_code error;
        fs::create_directories(folder, error);
        if (error) throw IoError(fmt::format("{}: cannot be made: {}", folder.string(), error.message()));
    });
    try {
        run_together(team, [&] {
            write_map_part(map, share.own(), team.rank(), folder, flags.vdb, progress.part(0, 0.4));
        });
        if (folder != fs::path(flags.out))
            by_the_first([&] { write_whole(flags, folder, progress.part(0.4, 1), result, session); });
    } catch (const std::exception&) {
        try {
            if (team.rank() == 0) remove_map_parts(folder);
        } catch (const IoError&) {  // what went wrong first is what there is to tell
        }
        throw;
    }
    session.end_stage();
}

void write_filtered(const MapFilterFlags& flags, const FilterInput& input, std::uint64_t bytes_sent,
                    Json& result, Session& session) {
    if (!input.part) return write_filtered(flags, input.in.map, result, session);
    std::vector<std::uint64_t> sent{bytes_sent};
    session.team->add_up(sent);
    result["members"] = session.team->size();
    result["bytes_sent"] = sent[0];
    write_by_team(flags, input.in.map, *input.part, result, session);
}

std::optional<MrcWriteReport> merge_parts(const fs::path& folder, const std::string& out,
                                          const MapReadOptions& read, const VdbWriteOptions& vdb,
                                          const MrcWriteOptions& mrc, const Progress& progress) {
    const MapParts parts(folder);
    if (!has_ending(out, ".vdb")) return parts.write_mrc(out, mrc, progress);
    parts.write_vdb(out, vdb, read.memory_limit() / 4,
                    read.scratch.empty() ? fs::absolute(out).parent_path() : read.scratch, progress);
    return std::nullopt;
}

}  // namespace vdbgeo::app
