// vdbgeo info: what is in a map, a grid or a mesh.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "converters/strip_source.h"
#include "vdbgeo/measure/isovalue_table.h"
#include "vdbgeo/measure/self_intersections.h"

namespace vdbgeo::app {
namespace {

struct InfoOptions {
    std::vector<std::string> files;
    bool validate = false, isovalues = false;
    std::string plot;
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
    } else if (is_mesh_input(file)) {
        j["kind"] = "mesh";
        const TriMesh mesh = read_mesh(file, progress.part(0, 0.3));
        j.update(measures_json(measure_mesh(mesh, progress.part(0.3, 0.6))));
        if (have_self_intersections()) {
            const auto pairs = self_intersections(mesh, progress.part(0.6, 1));
            j["self_intersections"] = pairs.size();
        }
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

/// Isovalue → volume, area and pieces of the surface, as numbers, as lines and as a picture.
Json isovalue_rows(const std::string& file, const InfoOptions& options, std::vector<std::string>& lines,
                   Session& session) {
    const MapFile in = read_map(file, options.map.options, session.stage("reading"));
    const auto rows = naming(file, [&] { return isovalue_table(in.map, {}, session.stage("surfaces")); });
    session.end_stage();
    Json table = Json::array();
    lines.push_back(fmt::format("{:>12} {:>8} {:>14} {:>14} {:>8}", "isovalue", "sigmas", "volume Å³",
                                "area Å²", "pieces"));
    const Statistics& s = in.map.statistics;
    for (const IsovalueRow& row : rows) {
        const double sigmas = s.rms > 0 ? (row.isovalue - s.mean) / s.rms : 0;
        table.push_back({{"isovalue", row.isovalue},
                         {"sigmas", sigmas},
                         {"volume_A3", row.volume_A3},
                         {"area_A2", row.area_A2},
                         {"components", row.components}});
        lines.push_back(fmt::format("{:>12.5g} {:>8.3g} {:>14.6g} {:>14.6g} {:>8}", row.isovalue, sigmas,
                                    row.volume_A3, row.area_A2, row.components));
    }
    if (!options.plot.empty()) plot_isovalues(rows, options.plot);
    return table;
}

void check_info(const InfoOptions& options) {
    if (!options.plot.empty() && !has_ending(options.plot, ".png"))
        throw UsageError(fmt::format("{}: pictures are PNG files: .png", options.plot));
    if (!options.isovalues && !options.plot.empty()) throw UsageError("--plot needs --isovalues");
    if (!options.plot.empty() && options.files.size() > 1)
        throw UsageError("--plot draws the isovalues of one map");
    if (options.isovalues)
        for (const std::string& file : options.files)
            if (file == "-" || is_mesh_input(file))
                throw UsageError(fmt::format("{}: --isovalues is of maps and grids in files", file));
}

void run_info(const InfoOptions& options, Session& session) {
    check_info(options);
    for (const std::string& file : options.files)
        if (file == "-" && options.validate)
            throw UsageError("-: --validate reads a file more than once, which a pipe does not allow");
    Json all = Json::array();
    for (const std::string& file : options.files) {
        Json j = describe(file, options, session);
        std::vector<std::string> lines = as_lines(j);
        if (options.validate && j.contains("departures") && j["departures"].empty())
            lines.emplace_back("departures from MRC2014: none");
        if (options.isovalues) j["isovalues"] = isovalue_rows(file, options, lines, session);
        if (file != options.files.back()) lines.emplace_back();
        if (!session.json)
            for (const std::string& line : lines) session.say(line);
        all.push_back(std::move(j));
    }
    session.result(all.size() == 1 ? all[0] : Json{{"files", all}});
}

}  // namespace

Command info_command() {
    return {"info", "Header, statistics and topology of maps, grids and meshes",
            "  vdbgeo info emd_1080.map --validate\n"
            "  vdbgeo info emd_1080.map --isovalues --plot levels.png",
            [](CLI::App& app) {
                auto o = std::make_shared<InfoOptions>();
                app.add_option("files", o->files, "Maps (MRC, CCP4), VDB grids or meshes")->required();
                app.add_flag("--validate", o->validate, "List every departure of a map file from MRC2014");
                app.add_flag("--isovalues", o->isovalues,
                             "A table of a map: isovalue, enclosed volume, area and pieces of the surface");
                app.add_option("--plot", o->plot, "Draw that table as a PNG here");
                o->map.add_reading(app);
                return [o](Session& session) {
                    o->map.finish();
                    run_info(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
