// vdbgeo info: what is in a map, a grid or a mesh.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "converters/mesh_file.h"
#include "converters/strip_source.h"

namespace vdbgeo::app {
namespace {

struct InfoOptions {
    std::vector<std::string> files;
    bool validate = false;
    MapFlags map;
};

Json describe(const std::string& file, const InfoOptions& options, Session& session) {
    Json j{{"file", file}};
    const auto progress = session.stage("reading");
    if (is_vdb_file(file) || is_vdb_ending(file)) {
        j["kind"] = "grid";
        Json grids = Json::array();
        for (const VdbGridInfo& g : list_vdb(file)) grids.push_back({{"name", g.name}, {"type", g.type}});
        const MapFile in = read_map(file, options.map.options, progress);
        j.update(grid_json(in.map));
        j["grids"] = grids;
        Json metadata = Json::object();
        for (auto it = in.map.grid->beginMeta(); it != in.map.grid->endMeta(); ++it)
            if (it->first.rfind("mrc_", 0) == 0 || it->first.rfind("vdbgeo_history", 0) == 0)
                metadata[it->first] = it->second->str();
        j["metadata"] = metadata;
    } else if (is_mesh_ending(file)) {
        j["kind"] = "mesh";
        j.update(measures_json(measure_mesh(read_mesh(file, progress.part(0, 0.5)), progress.part(0.5, 1))));
    } else {
        j["kind"] = "map";
        StripSource source(file, options.map.options, 1);
        const Statistics statistics = strip_statistics(source, progress);
        j.update(mrc_json(source.reader(), statistics, source.warnings()));
        if (options.validate) j["departures"] = validate_mrc(file);
    }
    session.end_stage();
    return j;
}

void run_info(const InfoOptions& options, Session& session) {
    for (const std::string& file : options.files)
        if (file == "-" && options.validate)
            throw UsageError("-: --validate reads a file more than once, which a pipe does not allow");
    Json all = Json::array();
    for (const std::string& file : options.files) {
        Json j = describe(file, options, session);
        if (!session.json) {
            for (const std::string& line : as_lines(j)) session.say(line);
            if (options.validate && j.contains("departures") && j["departures"].empty())
                session.say("departures from MRC2014: none");
            if (file != options.files.back()) session.say("");
        }
        all.push_back(std::move(j));
    }
    session.result(all.size() == 1 ? all[0] : Json{{"files", all}});
}

}  // namespace

Command info_command() {
    return {"info", "Header, statistics and topology of maps, grids and meshes",
            "  vdbgeo info emd_1080.map --validate", [](CLI::App& app) {
                auto o = std::make_shared<InfoOptions>();
                app.add_option("files", o->files, "Maps (MRC, CCP4), VDB grids or meshes")->required();
                app.add_flag("--validate", o->validate, "List every departure of a map file from MRC2014");
                o->map.add_reading(app);
                return [o](Session& session) {
                    o->map.finish();
                    run_info(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
