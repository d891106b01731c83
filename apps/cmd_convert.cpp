// vdbgeo convert (also mrc2vdb and vdb2mrc): map, grid and mesh files into each other.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/map_output.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

struct ConvertOptions {
    std::string in, out;
    MapFlags map;
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

/// What rounding cost, where values were rounded.
void report_rounding(const ConvertOptions& o, const MapFile& in, Json& j, Session& session) {
    const auto tell = [&](const char* what, const RoundingError& e) {
        if (!session.json && !session.quiet)
            session.say(fmt::format("{}: {}: largest error {:.3g}, relative {:.3g}", o.out, what, e.largest,
                                    e.largest_relative));
        return Json{{"largest_error", e.largest}, {"largest_relative_error", e.largest_relative},
                    {"at", {e.at.x(), e.at.y(), e.at.z()}}};
    };
    if (in.quantisation) {
        j["quantisation"] = tell(fmt::format("rounded to multiples of {}", *in.quantisation).c_str(), in.rounding);
        j["quantisation"]["step"] = *in.quantisation;
    }
    if (o.vdb.half) j["half"] = tell("stored as 16-bit floats", in.half_error);
}

/// To a VDB file: map files within the memory allowed, grids as they are.
void convert_to_grid(const ConvertOptions& o, const MapReadOptions& options, Session& session) {
    Json seconds;
    Clock clock;
    const auto progress = session.stage("reading");
    MapFile in = is_vdb_file(o.in) ? read_map(o.in, options, progress) : stream_map(o.in, options, o.vdb, progress);
    if (is_vdb_file(o.in) && o.vdb.half) in.half_error = naming(o.in, [&] {
        const RoundingError error = half_rounding_error(*in.map.grid);
        check_half_range(error);
        return error;
    });
    seconds["read"] = clock.lap();
    for (const std::string& w : in.warnings) session.warn(o.in + ": " + w);
    if (in.map.grid->activeVoxelCount() == 0)
        throw NumericalError(fmt::format(
            "{}: no sample is kept: the values lie between {:.6g} and {:.6g}; try another --threshold", o.in,
            in.map.statistics.min, in.map.statistics.max));
    write_vdb({in.map.grid}, o.out, o.vdb, session.stage("writing"));
    seconds["write"] = clock.lap();
    session.end_stage();
    Json j{{"in", o.in}, {"out", o.out}};
    j.update(grid_json(in.map));
    j["warnings"] = in.warnings;
    j["notes"] = in.notes;
    if (!session.json && !session.quiet) {
        for (const std::string& note : in.notes) session.say(o.in + ": " + note);
        session.say(
            fmt::format("{}: {} active voxels, {:.1f} MB in memory where the dense map takes {:.1f} MB",
                        o.out, j["active_voxels"].dump(), j["bytes_in_memory"].get<double>() / 1e6,
                        j["dense_bytes"].get<double>() / 1e6));
    }
    report_rounding(o, in, j, session);
    j["seconds"] = seconds;
    session.result(j);
}

/// A grid to a map file, where something is asked for that it would have to be loaded for, or warned of.
void convert_loaded_grid(const ConvertOptions& o, const MapReadOptions& options, Session& session) {
    Json seconds;
    Clock clock;
    const MapFile in = read_map(o.in, options, session.stage("reading"));
    seconds["read"] = clock.lap();
    for (const std::string& w : in.warnings) session.warn(o.in + ": " + w);
    if (in.map.grid->activeVoxelCount() == 0)
        throw NumericalError(fmt::format("{}: no sample is kept: the grid has no active voxel", o.in));
    const auto written = write_map(in.map, o.out, o.vdb, o.mrc, session.stage("writing"));
    seconds["write"] = clock.lap();
    session.end_stage();
    Json j{{"in", o.in}, {"out", o.out}};
    j.update(grid_json(in.map));
    j["warnings"] = in.warnings;
    j["seconds"] = seconds;
    if (written) report_written(o.out, *written, j, session);
    session.result(j);
}

/// Nothing is asked for that a grid would have to be loaded for, or warned of.
bool taken_as_it_is(const MapReadOptions& o) {
    return !o.sparsify.threshold && !o.sparsify.band && !o.threshold && !o.sparsify.background && !o.crop && o.bin == 1 &&
           o.normalise == MapReadOptions::Normalise::none && !o.quantise && !o.needs_selection() &&
           !o.invert && !o.mrc.voxel_size_A && o.mrc.origin == OriginRule::automatic;
}

void run_convert(const ConvertOptions& o, Session& session) {
    if (is_mesh_ending(o.in)) return convert_mesh(o, session);
    if (is_mesh_ending(o.out))
        throw UsageError(fmt::format("{}: a map becomes a mesh at an isovalue: use vdbgeo surface", o.out));
    check_map_output(o.out, session);
    MapReadOptions options = o.map.options;
    const std::filesystem::path folder = std::filesystem::path(o.out).parent_path();
    if (o.out != "-") options.scratch = folder.empty() ? "." : folder;  // there is room for the output there
    if (is_vdb_ending(o.out)) return convert_to_grid(o, options, session);
    if (!is_vdb_file(o.in)) return convert_map_to_map(o.in, o.out, options, o.mrc, session);
    if (taken_as_it_is(options)) return convert_grid_to_map(o.in, o.out, options.grid, o.mrc, session);
    convert_loaded_grid(o, options, session);
}

}  // namespace

Command convert_command() {
    return {"convert", "Convert between map (MRC, CCP4), grid (VDB) and mesh files, by their endings",
            "  vdbgeo convert emd_1080.map emd_1080.vdb --threshold 1.5sigma", [](CLI::App& app) {
                auto o = std::make_shared<ConvertOptions>();
                app.add_option("in", o->in, "Map, grid or mesh file; - reads a map from a pipe")->required();
                app.add_option("out", o->out,
                               "File to write: .vdb; .mrc .map .ccp4 .rec, also with .gz; .ply .obj .off "
                               ".stl; - is an MRC "
                               "map for a pipe")
                    ->required();
                o->map.add_reading(app);
                o->map.add_sparsify(app);
                o->map.add_memory(app);
                add_vdb_flags(app, o->vdb);
                app.add_option("--mode", o->mrc.mode,
                               "MRC mode to write: 0, 1, 2, 6, 12 or 101 [the input's, else 2]");
                add_map_output_flags(app, o->mrc);
                return [o](Session& session) {
                    o->map.finish();
                    check_usage(o->mrc);
                    run_convert(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
