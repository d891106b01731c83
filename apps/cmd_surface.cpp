// vdbgeo surface: the surface of a map at an isovalue, or the surfaces of a segmentation.
#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/label_stages.h"
#include "apps/mesh_command.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "apps/surface_in_blocks.h"
#include "apps/team_filter.h"
#include "converters/mesh_file.h"
#include "vdbgeo/blocks/team_marching_cubes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/run_together.h"
#include "vdbgeo/surface/label_surfaces.h"

namespace vdbgeo::app {
namespace {

struct SurfaceOptions {
    std::string in, out, labels;
    bool split = false;
    MapFlags map;
    IsoFlag iso;
    SurfaceFlags surface;
    ComponentFlags components;
    LabelSurfacesOptions label_options;
    std::vector<std::int64_t> wanted;  ///< labels, none for all
};

/// Drops pieces where asked; tells how many went.
TriMesh keep_pieces(TriMesh mesh, const SurfaceOptions& o, Session& session) {
    if (!o.components.any()) return mesh;
    mesh = filter_components(mesh, o.components.filter, session.stage("pieces"));
    if (mesh.empty())
        throw NumericalError(fmt::format(
            "{}: no piece of the surface is left; drop fewer (--keep-largest, --min-volume, --min-area)",
            o.in));
    return mesh;
}

void write_surface(const TriMesh& mesh, const SurfaceOptions& o, Json& j, Session& session) {
    const Progress progress = session.stage("writing");
    if (o.split)
        j["files"] = write_pieces(mesh, o.out, progress);
    else
        write_mesh(mesh, o.out, {}, progress);
    session.end_stage();
}

/// What is said comes when the file is there.
void finish(const TriMesh& mesh, const SurfaceOptions& o, const Json& head,
            const std::vector<std::string>& lines, Json seconds, Clock& clock, Session& session) {
    const MeshMeasures measures = measure_mesh(mesh, session.stage("measuring"));
    seconds["compute"] = clock.lap();
    Json j = measures_json(measures);
    j.update(head);
    write_surface(mesh, o, j, session);
    seconds["write"] = clock.lap();
    j["seconds"] = seconds;
    if (!session.json) {
        for (const std::string& line : lines) session.say(line);
        for (const std::string& line : measures_text(measures)) session.say(line);
    }
    say_where_open(measures, session);
    session.result(j);
}

void run_labels(const SurfaceOptions& o, const MapFile& in, Json seconds, Clock& clock, Session& session) {
    need_labels(o.in, in.map);
    LabelSurfacesOptions options = o.label_options;
    options.labels = o.wanted;
    auto surfaces = naming(o.in, [&] { return label_surfaces(in.map, options, session.stage("surfaces")); });
    Json rows = Json::array();
    std::vector<std::string> lines;
    for (LabelSurface& s : surfaces) {
        if (o.components.any()) s.mesh = filter_components(s.mesh, o.components.filter);
        const MeshMeasures m = measure_mesh(s.mesh);
        rows.push_back({{"label", s.label},
                        {"components", m.components},
                        {"faces", m.faces},
                        {"area_A2", m.area_A2},
                        {"volume_A3", m.volume_A3 ? Json(*m.volume_A3) : Json()}});
        lines.push_back(fmt::format("label {:<5} {:>7} pieces {:>9} faces, {:.6g} Å², {}", s.label,
                                    m.components, m.faces, m.area_A2,
                                    m.volume_A3 ? fmt::format("{:.6g} Å³", *m.volume_A3) : "open"));
    }
    if (surfaces.empty()) throw NumericalError(fmt::format("{}: there is no label but 0", o.in));
    const TriMesh mesh = join_labels(surfaces, o.in);
    if (mesh.empty())
        throw NumericalError(fmt::format("{}: no piece of any label is left; drop fewer", o.in));
    for (const char* ending : {".glb", ".obj", ".off", ".stl"})
        if (has_ending(o.out, ending))
            session.warn(fmt::format("{}: {} files do not keep which face is of which label", o.out, ending));
    finish(mesh, o, {{"method", "labels"}, {"labels", rows}}, lines, seconds, clock, session);
}

/// Whether the surface is made and written block after block where the map does not fit.
bool streams(const SurfaceOptions& o) {
    return o.surface.method == "marching-cubes" && !o.surface.cap && !o.split && !o.components.any() &&
           o.labels.empty();
}

/// What the surface of a map that is in memory takes.
WholeNeed need_of(const SurfaceOptions& o) {
    if (!o.labels.empty()) return WholeNeed::of_labels();
    if (o.surface.method == "dual") return WholeNeed::of_dual();
    if (o.surface.method == "delaunay") return WholeNeed::of_delaunay();
    return streams(o) ? WholeNeed{} : WholeNeed::of_pieces();
}

void write_in_blocks(const SurfaceOptions& o, const Isovalue& rule, SurfaceInBlocks& surface, Json seconds,
                     Clock& clock, Session& session) {
    if (!has_ending(o.out, ".ply"))
        throw UsageError(
            fmt::format("{}: a surface that does not fit into --memory is written as .ply; vdbgeo convert "
                        "makes others of it",
                        o.out));
    surface.write(o.out, session);
    seconds["write"] = clock.lap();
    if (!session.json) {
        session.say(fmt::format("isovalue    {:.6g} ({})", surface.isovalue(), rule.text()));
        session.say(fmt::format("surface     {} vertices, {} faces, in {} blocks", surface.vertices(),
                                surface.triangles(), surface.blocks()));
    }
    session.result({{"vertices", surface.vertices()},
                    {"faces", surface.triangles()},
                    {"iso", surface.isovalue()},
                    {"iso_rule", rule.text()},
                    {"method", o.surface.method},
                    {"blocks", surface.blocks()},
                    {"seconds", seconds}});
}

/// Within --memory: the map, if it and its surface fit. Else nothing: then the surface is written.
std::optional<MapFile> read_if_it_fits(const SurfaceOptions& o, const Isovalue& rule, Json& seconds,
                                       Clock& clock, Session& session) {
    check_folder_of(o.out);
    MapReadOptions options = o.map.options;
    if (options.scratch.empty()) options.scratch = std::filesystem::absolute(o.out).parent_path();
    const Isovalue any_label{Isovalue::Rule::value, 0.5};
    SurfaceInBlocks surface(o.in, options, o.labels.empty() ? rule : any_label, session);
    seconds["count"] = clock.lap();
    const double bytes = surface.bytes_as_whole(need_of(o));
    if (bytes <= static_cast<double>(options.memory_limit())) return surface.whole(session);
    if (!streams(o))
        throw NumericalError(fmt::format(
            "{}: the map and its surface take about {:.1f} GB, more than --memory; marching cubes without "
            "--cap, --split, --labels and flags that drop pieces goes through the map in blocks; or try "
            "--crop or --bin 2",
            o.in, bytes / (1 << 30)));
    write_in_blocks(o, rule, surface, seconds, clock, session);
    return {};
}

void run_surface(const SurfaceOptions& o, Session& session) {
    check_mesh_output(o.out);
    const Isovalue rule = o.iso.parse();
    Json seconds;
    Clock clock;
    std::optional<MapFile> read;
    if (o.map.options.memory) {
        read = read_if_it_fits(o, rule, seconds, clock, session);
        if (!read) return;
    } else {
        read = read_map(o.in, o.map.options, session.stage("reading"));
        for (const std::string& w : read->warnings) session.warn(o.in + ": " + w);
    }
    const MapFile& in = *read;
    seconds["read"] = clock.lap();
    if (!o.labels.empty()) return run_labels(o, in, seconds, clock, session);
    const Surface surface = extract_surface(o.in, in, rule, session.stage("surface"), o.surface);
    const TriMesh mesh = keep_pieces(surface.mesh, o, session);
    finish(mesh, o, {{"iso", surface.isovalue}, {"iso_rule", rule.text()}, {"method", o.surface.method}},
           {fmt::format("isovalue    {:.6g} ({})", surface.isovalue, rule.text())}, seconds, clock, session);
}

void check_for_team(const SurfaceOptions& o, const Isovalue& rule) {
    if (!has_ending(o.out, ".ply")) throw UsageError(o.out + ": a team writes .ply");
    check_folder_of(o.out);
    if (o.surface.method != "marching-cubes" || o.surface.cap)
        throw UsageError("a team runs marching cubes, without --cap");
    if (o.components.any() || o.split || !o.labels.empty())
        throw UsageError(
            "pieces and labels: a team writes the surface whole; vdbgeo components takes it apart");
    if (rule.needs_samples())
        throw UsageError("--iso: a team takes a density, a number of sigmas, record:FILE or auto");
}

/// Every member puts what it has where it belongs in one file, which the first makes, and which has its name
/// when all of it is there.
void write_by_team(const TeamSurface& surface, const std::string& out, Team& team, const Progress& progress) {
    const std::string unfinished = out + ".unfinished";
    const bool first = team.rank() == 0;
    std::error_code error;
    std::optional<PlyPieces> file;
    const auto open = [&] { file.emplace(unfinished, first, surface.vertices, surface.triangles); };
    try {
        run_together(team, [&] {
            if (first) open();
        });
        run_together(team, [&] {
            if (!first) open();
            if (first) file->put_header();
            put_piece(surface.piece, *file);
            progress.report(0.5);
            file->close();
        });
        run_together(team, [&] {
            if (first) std::filesystem::rename(unfinished, out, error);
            if (error) throw IoError(fmt::format("{}: cannot be written: {}", out, error.message()));
        });
    } catch (const std::exception&) {
        if (first) std::filesystem::remove(unfinished, error);
        throw;
    }
}

/// Every member extracts the surface in its part and puts it where it belongs in the one file.
void run_surface_by_team(const SurfaceOptions& o, Session& session) {
    const Isovalue rule = o.iso.parse();
    check_for_team(o, rule);
    Team& team = *session.team;
    Json seconds;
    Clock clock;
    const MapOfTeam map = read_for_team(o.in, o.map.options, leaf::dim, true, session);
    seconds["read"] = clock.lap();
    const DensityMap& part = map.in.map;
    const TeamSurface surface = naming(o.in, [&] {
        MarchingCubesOptions options;
        options.isovalue = rule.resolve(part.statistics, part.grid->getGridClass());
        if (map.in.level_set) options.isovalue = -options.isovalue;
        return team_marching_cubes(map.in.level_set ? turned_over(part) : part, options, map.share,
                                   session.stage("surface"));
    });
    const double iso = rule.resolve(part.statistics, part.grid->getGridClass());
    if (surface.triangles == 0)
        throw NumericalError(
            fmt::format("{}: no surface at the isovalue {:.6g}: the map's values lie between {:.6g} and "
                        "{:.6g}; try another --iso",
                        o.in, iso, part.statistics.min, part.statistics.max));
    seconds["compute"] = clock.lap();
    write_by_team(surface, o.out, team, session.stage("writing"));
    session.end_stage();
    seconds["write"] = clock.lap();
    std::vector<std::uint64_t> sent{surface.bytes_sent};
    team.add_up(sent);
    if (!session.json) {
        session.say(fmt::format("isovalue    {:.6g} ({})", iso, rule.text()));
        session.say(fmt::format("surface     {} vertices, {} faces", surface.vertices, surface.triangles));
    }
    session.result({{"vertices", surface.vertices},
                    {"faces", surface.triangles},
                    {"iso", iso},
                    {"iso_rule", rule.text()},
                    {"method", o.surface.method},
                    {"members", team.size()},
                    {"bytes_sent", sent[0]},
                    {"seconds", seconds}});
}

}  // namespace

Command surface_command() {
    return {"surface", "Extract the surface of a map or grid at an isovalue, or those of a segmentation",
            "  vdbgeo surface emd_1080.map groel.ply --iso 0.8\n"
            "  vdbgeo surface emd_1080.map large.ply --iso 0.8 --memory 2G\n"
            "  vdbgeo surface emd_1080.map good.ply --iso 0.8 --method delaunay --keep-largest 1",
            [](CLI::App& app) {
                auto o = std::make_shared<SurfaceOptions>();
                app.add_option("in", o->in, "Map (MRC, CCP4), VDB grid, or a folder of parts")->required();
                app.add_option("out", o->out, "Mesh to write: " + mesh_endings_text())->required();
                o->iso.add(app);
                o->surface.add(app);
                o->components.add(app);
                app.add_flag("--split", o->split,
                             "One file a piece, the largest first: OUT_0001.ply and so on");
                app.add_option("--labels", o->labels,
                               "The map is a segmentation: smooth closed surfaces of all its labels, or of a "
                               "list such as 1,2,5");
                app.add_option("--label-iterations", o->label_options.iterations,
                               "Rounds of smoothing of the labels' surfaces, 0 for the bare staircase")
                    ->capture_default_str();
                o->map.add_reading(app);
                o->map.add_sparsify(app);
                o->map.add_memory(app);
                app.get_option("--memory")
                    ->description(
                        "Memory that may be taken, such as 2G or 512M: where map and surface do not fit, "
                        "marching "
                        "cubes goes through the map in blocks, into a .ply file [as it comes]");
                app.add_option("--scratch", o->map.options.scratch,
                               "Folder for temporary files, which have no name [the output's]");
                return [o, flags = &app](Session& session) {
                    o->map.finish();
                    o->surface.finish(*flags);
                    if (o->labels.empty()) {
                        refuse_flags(*flags, {"--label-iterations"}, "belongs to --labels");
                    } else {
                        refuse_flags(*flags, {"--iso", "--method", "--cap"}, "means nothing with --labels");
                        o->wanted = parse_labels(o->labels);
                    }
                    check_usage(o->components.filter);
                    check_usage(o->label_options);
                    session.team ? run_surface_by_team(*o, session) : run_surface(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
