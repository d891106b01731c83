// vdbgeo merge: a map in parts, as members of a team write it, becomes one file.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/map_output.h"
#include "apps/stages.h"
#include "apps/team_filter.h"
#include "converters/map_parts.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

struct MergeOptions {
    std::string in, out;
    MapFlags map;
    VdbWriteOptions vdb;
    MrcWriteOptions mrc;
};

void run_merge(MergeOptions& o, Session& session) {
    o.map.finish();
    check_usage(o.mrc);
    check_map_output(o.out, session);
    if (has_ending(o.out, ".nvdb"))
        throw UsageError(o.out + ": parts become .vdb or map files; vdbgeo convert makes .nvdb of them");
    if (!is_map_parts(o.in)) throw InvalidInput(o.in + ": no folder of parts (part_0000.vdb ...)");
    Clock clock;
    Json j{{"in", o.in}, {"out", o.out}};
    const auto report = merge_parts(o.in, o.out, o.map.options, o.vdb, o.mrc, session.stage("merging"));
    session.end_stage();
    if (report) report_written(o.out, *report, j, session);
    j["seconds"] = {{"all", clock.seconds()}};
    session.result(j);
}

}  // namespace

Command merge_command() {
    return {"merge", "Make one file of a map that vdbgeo-mpi left in parts",
            "  vdbgeo merge smooth.parts smooth.mrc", [](CLI::App& app) {
                auto o = std::make_shared<MergeOptions>();
                app.add_option("in", o->in, "Folder of parts: part_0000.vdb ...")->required();
                app.add_option("out", o->out, "Map to write: .mrc .map .ccp4 .rec or .vdb")->required();
                o->map.add_memory(app);
                add_vdb_flags(app, o->vdb);
                app.add_option("--mode", o->mrc.mode, "MRC mode to write: 0, 1, 2, 6, 12 or 101 [2]");
                add_map_output_flags(app, o->mrc);
                return [o](Session& session) { run_merge(*o, session); };
            }};
}

}  // namespace vdbgeo::app
