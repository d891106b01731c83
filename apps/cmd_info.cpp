// vdbgeo info: what is in a map, a grid or a mesh.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/density_plot.h"
#include "apps/flags.h"
#include "apps/plots.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "apps/tet_reports.h"
#include "converters/mesh_file.h"
#include "converters/strip_source.h"
#include "converters/tet_file.h"
#include "vdbgeo/measure/isovalue_table.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/tet/tet_quality.h"
#include "vdbgeo/volume/density_histogram.h"
#include "vdbgeo/volume/isovalue.h"

namespace vdbgeo::app {
namespace {

struct InfoOptions {
    std::vector<std::string> files;
    bool validate = false, isovalues = false;
    std::string plot, histogram;
    PlotFlags plots;
    IsoFlag iso{""};
    MapFlags map;
};

/// Tetrahedra, and the surface around them.
Json describe_tets(const std::string& file, std::vector<std::string>& lines, Session& session) {
    const auto progress = session.stage("reading");
    const TetMesh mesh = read_tets(file, progress.part(0, 0.5));
    const TetQuality quality = naming(file, [&] { return measure_tets(mesh, progress.part(0.5, 0.8)); });
    const MeshMeasures boundary = measure_mesh(boundary_surface(mesh), progress.part(0.8, 1));
    session.end_stage();
    Json j{{"file", file}, {"kind", "tets"}};
    lines = {fmt::format("file        {}", file), "kind        tetrahedra"};
    j.update(tets_json(quality));
    j["interface_faces"] = mesh.faces.size() - boundary.faces;
    j["boundary"] = measures_json(boundary);
    for (std::string& line : tets_text(quality)) lines.push_back(std::move(line));
    lines.push_back(fmt::format("boundary    {} faces in {} pieces, {:.6g} Å²", boundary.faces,
                                boundary.components, boundary.area_A2));
    if (boundary.faces < mesh.faces.size())
        lines.push_back(
            fmt::format("interfaces  {} faces between regions", mesh.faces.size() - boundary.faces));
    std::vector<std::string> names;
    for (const auto* all : {&mesh.vertex_properties, &mesh.tet_properties})
        for (const MeshProperty& p : *all) names.push_back(p.name);
    j["properties"] = names;
    if (!names.empty()) lines.push_back(fmt::format("properties  {}", fmt::join(names, ", ")));
    return j;
}

/// What a file holds, as JSON and as lines.
Json describe(const std::string& file, const InfoOptions& options, std::vector<std::string>& lines,
              Session& session) {
    if (holds_tets(file)) return describe_tets(file, lines, session);
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
    lines = as_lines(j);
    return j;
}

/// Isovalue → volume, area and pieces of the surface, as numbers, as lines and as a plot.
Json isovalue_rows(const std::string& file, const MapFile& in, const std::optional<MarkedLevel>& level,
                   const InfoOptions& options, std::vector<std::string>& lines, Session& session) {
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
    if (!options.plot.empty()) plot_isovalues(rows, options.plot, level, options.plots.theme());
    return table;
}

/// How many bars a plot of the usual width has room for.
constexpr std::size_t density_bins = 220;

/// The histogram of the densities, as numbers and as a plot.
Json density_counts(const std::string& file, const MapFile& in, const std::optional<MarkedLevel>& level,
                    const InfoOptions& options, Session& session) {
    const DensityHistogram h =
        naming(file, [&] { return density_histogram(in.map, density_bins, session.stage("counting")); });
    session.end_stage();
    if (h.non_finite > 0)
        session.warn(fmt::format("{}: {} voxels are no finite number: left out", file, h.non_finite));
    if (level && !(level->isovalue >= h.low && level->isovalue <= h.high))
        session.warn(fmt::format("{}: no density is near the isovalue {:.6g}", file, level->isovalue));
    const auto drawing = plot_densities(h, file, in.level_set, level, options.plots.theme());
    write_drawing(drawing, options.histogram);
    return {{"low", h.low}, {"high", h.high}, {"voxels", h.voxels}, {"counts", h.counts}};
}

/// What is drawn and counted of a map in memory.
void look_closer(const std::string& file, const InfoOptions& options, Json& j,
                 std::vector<std::string>& lines, Session& session) {
    const MapFile in = read_map(file, options.map.options, session.stage("reading"));
    std::optional<MarkedLevel> level;
    if (!options.iso.text.empty()) {
        level = marked_level(naming(file, [&] { return options.iso.parse().resolve(in.map); }),
                             in.map.statistics);
        j["iso"] = level->isovalue;
        lines.push_back(level->label);
    }
    if (!options.histogram.empty())
        j["density_histogram"] = density_counts(file, in, level, options, session);
    if (options.isovalues) j["isovalues"] = isovalue_rows(file, in, level, options, lines, session);
}

void check_info(const InfoOptions& options) {
    const bool drawn = !options.plot.empty() || !options.histogram.empty();
    check_plot_output(options.plot);
    check_plot_output(options.histogram);
    options.plots.check(drawn, "--histogram and --plot");
    if (!options.isovalues && !options.plot.empty()) throw UsageError("--plot needs --isovalues");
    if (!options.iso.text.empty()) {
        if (!drawn) throw UsageError("--iso: belongs to --histogram and --plot");
        options.iso.parse();
    }
    for (const auto& [path, what] : {std::pair(&options.plot, "--plot draws the isovalues"),
                                     std::pair(&options.histogram, "--histogram draws the densities")})
        if (!path->empty() && options.files.size() > 1) throw UsageError(fmt::format("{} of one map", what));
    const char* const flag = options.isovalues ? "--isovalues" : "--histogram";
    if (options.isovalues || !options.histogram.empty())
        for (const std::string& file : options.files)
            if (file == "-" || is_mesh_input(file) || is_tet_ending(file))
                throw UsageError(fmt::format("{}: {} is of maps and grids in files", file, flag));
}

void run_info(const InfoOptions& options, Session& session) {
    check_info(options);
    for (const std::string& path : {options.plot, options.histogram}) check_folder_of(path);
    for (const std::string& file : options.files)
        if (file == "-" && options.validate)
            throw UsageError("-: --validate reads a file more than once, which a pipe does not allow");
    Json all = Json::array();
    for (const std::string& file : options.files) {
        std::vector<std::string> lines;
        Json j = describe(file, options, lines, session);
        if (options.validate && j.contains("departures") && j["departures"].empty())
            lines.emplace_back("departures from MRC2014: none");
        if (options.isovalues || !options.histogram.empty()) look_closer(file, options, j, lines, session);
        if (file != options.files.back()) lines.emplace_back();
        if (!session.json)
            for (const std::string& line : lines) session.say(line);
        all.push_back(std::move(j));
    }
    session.result(all.size() == 1 ? all[0] : Json{{"files", all}});
}

}  // namespace

Command info_command() {
    return {"info", "Header, statistics and topology of maps, grids, meshes and tetrahedra",
            "  vdbgeo info emd_1080.map --validate\n"
            "  vdbgeo info emd_1080.map --isovalues --plot levels.png\n"
            "  vdbgeo info emd_1080.map --histogram density.svg --iso 0.8",
            [](CLI::App& app) {
                auto o = std::make_shared<InfoOptions>();
                app.add_option("files", o->files, "Maps (MRC, CCP4), VDB grids, meshes or tetrahedra")
                    ->required();
                app.add_flag("--validate", o->validate, "List every departure of a map file from MRC2014");
                app.add_flag("--isovalues", o->isovalues,
                             "A table of a map: isovalue, enclosed volume, area and pieces of the surface");
                app.add_option("--plot", o->plot, "Plot that table here (PNG or SVG)");
                app.add_option("--histogram", o->histogram,
                               "Plot the histogram of a map's densities here (PNG or SVG): of all samples, "
                               "of a VDB grid of the active voxels");
                o->iso.add(app);
                o->plots.add(app);
                o->map.add_reading(app);
                return [o](Session& session) {
                    o->map.finish();
                    run_info(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
