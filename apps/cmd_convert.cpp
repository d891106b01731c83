// vdbgeo convert (also mrc2vdb and vdb2mrc): map, grid, mesh and tetrahedra files into each other.
#include <fmt/format.h>

#include <filesystem>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/map_output.h"
#include "apps/reports.h"
#include "apps/scene.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "converters/nanovdb_file.h"
#include "converters/tet_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/placement.h"

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
    if (is_tet_ending(o.out) && !is_mesh_ending(o.out))
        throw UsageError(
            fmt::format("{}: a surface is filled with tetrahedra by vdbgeo tetrahedralize", o.out));
    if (!is_mesh_ending(o.out))
        throw UsageError(fmt::format("{}: a mesh becomes one of {}", o.out, mesh_endings_text()));
    const auto progress = session.stage("converting");
    const TriMesh mesh = read_mesh(o.in, progress.part(0, 0.5));
    write_mesh(mesh, o.out, {}, progress.part(0.5, 1));
    session.result(
        {{"in", o.in}, {"out", o.out}, {"vertices", mesh.points.size()}, {"faces", mesh.triangles.size()}});
}

/// Tetrahedra into another file of tetrahedra, or the surface around them into a mesh file.
void convert_tets(const ConvertOptions& o, Session& session) {
    if (!is_tet_ending(o.out) && !is_mesh_ending(o.out))
        throw UsageError(fmt::format("{}: tetrahedra become one of {}; their boundary one of {}", o.out,
                                     tet_endings_text(), mesh_endings_text()));
    const auto progress = session.stage("converting");
    const TetMesh mesh = read_tets(o.in, progress.part(0, 0.5));
    Json j{{"in", o.in}, {"out", o.out}};
    if (is_tet_ending(o.out)) {
        write_tets(mesh, o.out, progress.part(0.5, 1));
        j.update({{"vertices", mesh.points.size()}, {"tets", mesh.tets.size()}});
        const bool lost = !mesh.vertex_properties.empty() || !mesh.tet_properties.empty();
        if (lost && !has_ending(o.out, ".vtu"))
            session.warn(fmt::format("{}: properties are left out: only .vtu has them", o.out));
    } else {
        const TriMesh surface = boundary_surface(mesh);
        write_mesh(surface, o.out, {}, progress.part(0.5, 1));
        j.update({{"vertices", surface.points.size()}, {"faces", surface.triangles.size()}});
    }
    session.result(j);
}

/// What rounding cost, where values were rounded.
void report_rounding(const ConvertOptions& o, const MapFile& in, Json& j, Session& session) {
    const auto tell = [&](const std::string& what, const RoundingError& e) {
        if (!session.json && !session.quiet)
            session.say(fmt::format("{}: {}: largest error {:.3g}, relative {:.3g}", o.out, what, e.largest,
                                    e.largest_relative));
        return Json{{"largest_error", e.largest},
                    {"largest_relative_error", e.largest_relative},
                    {"at", {e.at.x(), e.at.y(), e.at.z()}}};
    };
    if (in.quantisation) {
        j["quantisation"] = tell(fmt::format("rounded to multiples of {}", *in.quantisation), in.rounding);
        j["quantisation"]["step"] = *in.quantisation;
    }
    if (o.vdb.half && is_vdb_ending(o.out)) j["half"] = tell("stored as 16-bit floats", in.half_error);
}

/// NumericalError where nothing is kept of a map.
void need_active(const std::string& file, const DensityMap& map) {
    if (map.grid->activeVoxelCount() > 0) return;
    throw NumericalError(fmt::format(
        "{}: no sample is kept: the values lie between {:.6g} and {:.6g}; try another --threshold", file,
        map.statistics.min, map.statistics.max));
}

/// Reads the map or grid and says what is odd about it.
MapFile read_for(const ConvertOptions& o, bool stream, Session& session) {
    const auto progress = session.stage("reading");
    MapFile in =
        stream ? stream_map(o.in, o.map.options, o.vdb, progress) : read_map(o.in, o.map.options, progress);
    for (const std::string& w : in.warnings) session.warn(o.in + ": " + w);
    need_active(o.in, in.map);
    if (!session.json && !session.quiet)
        for (const std::string& note : in.notes) session.say(o.in + ": " + note);
    return in;
}

Json result_of(const ConvertOptions& o, const MapFile& in) {
    return {{"in", o.in}, {"out", o.out}, {"warnings", in.warnings}, {"notes", in.notes}};
}

/// One line on a grid that was written as it is.
void say_size(const std::string& out, const Json& grid, Session& session) {
    if (session.json || session.quiet) return;
    session.say(fmt::format("{}: {} active voxels, {:.1f} MB in memory where the dense map takes {:.1f} MB",
                            out, grid["active_voxels"].dump(), grid["bytes_in_memory"].get<double>() / 1e6,
                            grid["dense_bytes"].get<double>() / 1e6));
}

/// The grids of a scene, or any grid that has to be in memory as a tree.
Json convert_loaded(const ConvertOptions& o, SceneLevels& levels, Session& session) {
    Json seconds;
    Clock clock;
    MapFile in = read_for(o, false, session);
    seconds["read"] = clock.lap();
    Json j = result_of(o, in);
    if (o.scene.wanted()) {
        const auto grids = scene_grids(o.in, in, o.scene, levels, session);
        seconds["compute"] = clock.lap();
        write_grids(grids, o.out, o.vdb, session.stage("writing"));
        j.update(scene_json(grids, o.scene, levels));
        if (!session.json && !session.quiet)
            for (const Json& grid : j["grids"])
                session.say(fmt::format("{}: {} ({}), {} active voxels", o.out,
                                        grid["name"].get<std::string>(), grid["class"].get<std::string>(),
                                        grid["active_voxels"].dump()));
    } else {
        if (o.vdb.half && is_vdb_ending(o.out)) {
            in.half_error = half_rounding_error(*in.map.grid);
            naming(o.in, [&] { check_half_range(in.half_error); });
        }
        const auto report = write_map(in.map, o.out, o.vdb, o.mrc, session.stage("writing"));
        j.update(grid_json(in.map));
        say_size(o.out, j, session);
        if (report) report_written(o.out, *report, j, session);
        report_rounding(o, in, j, session);
    }
    seconds["write"] = clock.lap();
    session.end_stage();
    j["seconds"] = seconds;
    return j;
}

/// A map file to a VDB file, within the memory allowed.
Json convert_streamed(const ConvertOptions& o, Session& session) {
    Json seconds;
    Clock clock;
    const MapFile in = read_for(o, true, session);
    seconds["read"] = clock.lap();
    write_vdb({in.map.grid}, o.out, o.vdb, session.stage("writing"));
    seconds["write"] = clock.lap();
    Json j = result_of(o, in);
    j.update(grid_json(in.map));
    say_size(o.out, j, session);
    report_rounding(o, in, j, session);
    j["seconds"] = seconds;
    return j;
}

/// Nothing is asked for that a grid would have to be loaded for, or warned of.
bool taken_as_it_is(const MapReadOptions& o) {
    return !o.sparsify.threshold && !o.sparsify.band && !o.threshold && !o.sparsify.background && !o.crop &&
           o.bin == 1 && o.normalise == MapReadOptions::Normalise::none && !o.quantise &&
           !o.needs_selection() && !o.invert && !o.mrc.voxel_size_A && o.mrc.origin == OriginRule::automatic;
}

/// Whether a grid of the file was placed in a scene: it has to be taken back to Å.
bool is_placed(const std::string& file) {
    for (const VdbGridInfo& grid : list_vdb(file))
        if (grid.metadata["vdbgeo_for"]) return true;
    return false;
}

Json convert_one(ConvertOptions o, SceneLevels& levels, Session& session) {
    const std::filesystem::path folder = std::filesystem::path(o.out).parent_path();
    if (o.out != "-") o.map.options.scratch = folder.empty() ? "." : folder;  // there is room for the output
    const bool from_grid = is_vdb_file(o.in);
    if (o.scene.wanted() || is_nanovdb_ending(o.out)) return convert_loaded(o, levels, session);
    if (is_vdb_ending(o.out))
        return from_grid ? convert_loaded(o, levels, session) : convert_streamed(o, session);
    if (!from_grid) return convert_map_to_map(o.in, o.out, o.map.options, o.mrc, session);
    if (taken_as_it_is(o.map.options) && !is_placed(o.in))
        return convert_grid_to_map(o.in, o.out, o.map.options.grid, o.mrc, session);
    return convert_loaded(o, levels, session);
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
            frames.push_back(convert_one(o, levels, session));
        }
    }
    session.result({{"frames", frames}});
}

void run_convert(ConvertOptions o, Session& session) {
    o.in = o.files.front();
    o.out = o.files.back();
    const bool series = o.files.size() > 2 || o.all_volumes;
    if (series && (is_mesh_input(o.in) || is_tet_ending(o.in) || o.out == "-"))
        throw UsageError("a series is made of maps, as numbered files");
    if (holds_tets(o.in)) return convert_tets(o, session);
    if (is_mesh_input(o.in)) return convert_mesh(o, session);
    if (is_mesh_ending(o.out))
        throw UsageError(fmt::format("{}: a map becomes a mesh at an isovalue: use vdbgeo surface", o.out));
    if (is_tet_ending(o.out))
        throw UsageError(fmt::format("{}: a map is filled with tetrahedra by vdbgeo tetrahedralize", o.out));
    check_map_output(o.out, session);
    if (o.scene.wanted() && !is_vdb_ending(o.out) && !is_nanovdb_ending(o.out))
        throw UsageError(fmt::format("{}: the grids of a scene go into a .vdb or .nvdb file", o.out));
    if (series) return convert_series(o, session);
    SceneLevels levels;
    session.result(convert_one(o, levels, session));
}

}  // namespace

Command convert_command() {
    return {"convert",
            "Convert between map (MRC, CCP4), grid (VDB), mesh and tetrahedra files, by their endings",
            "  vdbgeo convert emd_1080.map emd_1080.vdb --threshold 1.5sigma", [](CLI::App& app) {
                auto o = std::make_shared<ConvertOptions>();
                app.add_option("files", o->files,
                               "Map, grid, mesh or tetrahedra file (- reads a map from a pipe), and last the "
                               "file to write: "
                               ".vdb .nvdb; .mrc .map .ccp4 .rec, also with .gz; " +
                                   mesh_endings_text() + "; of tetrahedra " + tet_endings_text() +
                                   ", or a mesh of their boundary; - is an MRC map for a pipe. Several maps "
                                   "make a series: OUT_0001.vdb and so on")
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
                o->map.add_memory(app);
                o->scene.add(app);
                add_vdb_flags(app, o->vdb);
                app.add_option("--mode", o->mrc.mode,
                               "MRC mode to write: 0, 1, 2, 6, 12 or 101 [the input's, else 2]");
                add_map_output_flags(app, o->mrc);
                return [o](Session& session) {
                    o->map.finish();
                    o->scene.finish();
                    check_usage(o->mrc);
                    run_convert(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
