// vdbgeo convert (also mrc2vdb and vdb2mrc): map, grid and mesh files into each other.
#include <fmt/format.h>

#include <filesystem>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "apps/scene.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "converters/nanovdb_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

struct ConvertOptions {
    std::vector<std::string> files;  ///< inputs, and the output last
    std::string in, out;             ///< of the frame at hand
    bool all_volumes = false;
    MapFlags map;
    SceneFlags scene;
    VdbWriteOptions vdb;
    MrcWriteOptions mrc;
};

void convert_mesh(const ConvertOptions& o, Session& session) {
    if (!is_mesh_ending(o.out))
        throw UsageError(fmt::format("{}: a mesh becomes one of .ply .obj .off .stl", o.out));
    const auto progress = session.stage("converting");
    const TriMesh mesh = read_mesh(o.in, progress.part(0, 0.5));
    write_mesh(mesh, o.out, {}, progress.part(0.5, 1));
    session.result(
        {{"in", o.in}, {"out", o.out}, {"vertices", mesh.points.size()}, {"faces", mesh.triangles.size()}});
}

Json convert_map(const ConvertOptions& o, SceneLevels& levels, Session& session) {
    Json seconds;
    Clock clock;
    MapFile in = read_map(o.in, o.map.options, session.stage("reading"));
    take_back(o.in, in, session);
    seconds["read"] = clock.lap();
    for (const std::string& w : in.warnings) session.warn(o.in + ": " + w);
    if (in.map.grid->activeVoxelCount() == 0)
        throw NumericalError(fmt::format(
            "{}: no sample is kept: the values lie between {:.6g} and {:.6g}; try another --threshold", o.in,
            in.map.statistics.min, in.map.statistics.max));
    Json j{{"in", o.in}, {"out", o.out}};
    if (o.scene.wanted()) {
        const auto grids = scene_grids(o.in, in, o.scene, levels, session);
        seconds["compute"] = clock.lap();
        write_grids(grids, o.out, o.vdb, session.stage("writing"));
        j.update(scene_json(grids, o.scene, levels));
    } else {
        write_map(in.map, o.out, o.vdb, o.mrc, session.stage("writing"));
        j.update(grid_json(in.map));
    }
    seconds["write"] = clock.lap();
    session.end_stage();
    j["warnings"] = in.warnings;
    j["seconds"] = seconds;
    if (!session.json && !session.quiet && o.scene.wanted()) {
        for (const Json& grid : j["grids"])
            session.say(fmt::format("{}: {} ({}), {} active voxels", o.out, grid["name"].get<std::string>(),
                                    grid["class"].get<std::string>(), grid["active_voxels"].dump()));
    } else if (!session.json && !session.quiet) {
        session.say(
            fmt::format("{}: {} active voxels, {:.1f} MB in memory where the dense map takes {:.1f} MB",
                        o.out, j["active_voxels"].dump(), j["bytes_in_memory"].get<double>() / 1e6,
                        j["dense_bytes"].get<double>() / 1e6));
    }
    return j;
}

/// Several maps, or all volumes of a stack, as numbered files at the same levels.
void convert_series(ConvertOptions o, Session& session) {
    const std::string out = o.files.back();
    for (std::size_t f = 0; f + 1 < o.files.size(); ++f)
        if (!std::filesystem::exists(o.files[f]))
            throw IoError(fmt::format("{}: cannot be opened: no such file", o.files[f]));
    SceneLevels levels;
    Json frames = Json::array();
    int number = 0;
    for (std::size_t f = 0; f + 1 < o.files.size(); ++f) {
        o.in = o.files[f];
        const int volumes = o.all_volumes ? MrcReader(o.in, o.map.options.mrc).volumes() : 1;
        for (int v = 0; v < volumes; ++v) {
            if (o.all_volumes) o.map.options.mrc.volume = v;
            o.out = numbered(out, ++number);
            frames.push_back(convert_map(o, levels, session));
        }
    }
    session.result({{"frames", frames}});
}

void run_convert(ConvertOptions o, Session& session) {
    o.in = o.files.front();
    o.out = o.files.back();
    const bool series = o.files.size() > 2 || o.all_volumes;
    if (series && (is_mesh_ending(o.in) || o.out == "-"))
        throw UsageError("a series is made of maps, as numbered files");
    if (is_mesh_ending(o.in)) return convert_mesh(o, session);
    if (is_mesh_ending(o.out))
        throw UsageError(fmt::format("{}: a map becomes a mesh at an isovalue: use vdbgeo surface", o.out));
    check_map_output(o.out, session);
    if (o.scene.wanted() && !is_vdb_ending(o.out) && !is_nanovdb_ending(o.out))
        throw UsageError(fmt::format("{}: the grids of a scene go into a .vdb or .nvdb file", o.out));
    if (series) return convert_series(o, session);
    SceneLevels levels;
    session.result(convert_map(o, levels, session));
}

}  // namespace

Command convert_command() {
    return {"convert", "Convert between map (MRC, CCP4), grid (VDB) and mesh files, by their endings",
            "  vdbgeo convert emd_1080.map emd_1080.vdb --threshold 1.5sigma", [](CLI::App& app) {
                auto o = std::make_shared<ConvertOptions>();
                app.add_option(
                       "files", o->files,
                       "Map, grid or mesh file (- reads a map from a pipe), and last the file to write: "
                       ".vdb .nvdb; .mrc .map .ccp4 .rec; .ply .obj .off .stl; - is an MRC map for a "
                       "pipe. Several maps make a series: OUT_0001.vdb and so on")
                    ->required()
                    ->expected(2, -1)
                    ->type_name("IN... OUT");
                o->map.add_reading(app);
                app.get_option("--volume")
                    ->transform([o](const std::string& text) {
                        o->all_volumes = text == "all";
                        return o->all_volumes ? "0" : text;
                    })
                    ->description("Which volume of a stack of volumes, from 0; all makes a series");
                o->map.add_sparsify(app);
                o->scene.add(app);
                add_vdb_flags(app, o->vdb);
                app.add_option("--mode", o->mrc.mode,
                               "MRC mode to write: 0, 1, 2, 6, 12 or 101 [the input's, else 2]");
                return [o](Session& session) {
                    o->map.finish();
                    o->scene.finish();
                    check_usage(o->mrc);
                    run_convert(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
