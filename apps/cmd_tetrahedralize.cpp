// vdbgeo tetrahedralize: a map, a segmentation or a closed mesh filled with tetrahedra.
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/label_stages.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "apps/tet_compare.h"
#include "apps/tet_flags.h"
#include "apps/tet_reports.h"
#include "apps/tet_stages.h"
#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/measure/surface_distance.h"

namespace vdbgeo::app {
namespace {

struct TetrahedralizeOptions {
    std::string in, out, labels, histogram;
    PlotFlags plots;
    bool compare = false, no_distance = false;
    std::vector<std::int64_t> wanted;
    MapFlags map;
    IsoFlag iso;
    TetFlags tets;
    TetComponentFilter filter;
};

TetInput read_input(const TetrahedralizeOptions& o, Json& j, Session& session) {
    if (is_mesh_input(o.in)) return tet_input(o.in, read_mesh(o.in, session.stage("reading")), o.filter);
    const Isovalue rule = o.iso.parse();
    const MapFile in = read_map(o.in, o.map.options, session.stage("reading"));
    for (const std::string& w : in.warnings) session.warn(o.in + ": " + w);
    if (!o.labels.empty()) return tet_input(o.in, in, o.wanted, session.stage("labels"));
    TetInput input = tet_input(o.in, in, rule, o.filter, session.stage("isosurface"));
    j["iso"] = in.level_set ? -input.isovalue : input.isovalue;
    j["iso_rule"] = rule.text();
    return input;
}

/// What the boundary is against the surface that was to be filled.
void compare_with_surface(const TetInput& input, const TetMesh& mesh, double volume_A3, bool distance,
                          Json& j, std::vector<std::string>& lines, Session& session) {
    const MeshMeasures surface = measure_mesh(input.surface);
    j["surface_volume_A3"] = surface.volume_A3 ? Json(*surface.volume_A3) : Json();
    if (surface.volume_A3) {
        const double error = volume_A3 / *surface.volume_A3 - 1;
        j["volume_error"] = error;
        lines.push_back(fmt::format("surface     {:.6g} Å³ inside (Eq 10): the tetrahedra have {:+.3g} %",
                                    *surface.volume_A3, 100 * error));
    }
    if (!distance) return;
    const TriMesh boundary = boundary_surface(mesh);
    const SurfaceDistance d = surface_distance(input.surface, boundary, {}, session.stage("distance"));
    j["hausdorff_A"] = d.hausdorff;
    j["distance_to_boundary"] = one_sided_json(d.forward);
    j["distance_to_surface"] = one_sided_json(d.backward);
    lines.push_back(fmt::format("distance    {:.4g} Å at most from the surface, {:.4g} Å rms", d.backward.max,
                                d.backward.rms));
}

/// Largest resident memory of this process and of those it ran, in bytes.
std::uint64_t peak_bytes() {
    std::uint64_t peak = 0;
    for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
        struct rusage usage {};
        getrusage(who, &usage);
        peak = std::max(peak, static_cast<std::uint64_t>(usage.ru_maxrss) * 1024);
    }
    return peak;
}

void run_tetrahedralize(const TetrahedralizeOptions& o, Session& session) {
    check_folder_of(o.out);
    check_folder_of(o.histogram);
    Json head, seconds;
    Clock clock;
    const TetInput input = read_input(o, head, session);
    const std::string method = o.tets.method_for(input.source);
    head["method"] = method;
    seconds["read"] = clock.lap();
    const TetResult made = make_tets(input, method, o.tets, o.filter, session);
    clock.lap();
    seconds["surface"] = made.surface_seconds;
    seconds["compute"] = made.tet_seconds;
    if (made.optimized) seconds["optimize"] = made.optimize_seconds;

    const TetQuality quality = measure_tets(made.mesh, session.stage("measuring"));
    Json j = tets_json(quality);
    j.update(head);
    std::vector<std::string> lines = tets_text(quality);
    if (made.optimized) {
        const TetOptimizeReport& r = *made.optimized;
        j["optimize"] = {{"rounds", r.rounds},
                         {"moves", r.moves},
                         {"flips", r.flips},
                         {"outside_before", r.outside_before},
                         {"outside_after", r.outside_after}};
        lines.push_back(
            fmt::format("optimized   {} moves, {} flips in {} rounds; out of the bounds {}, then {}", r.moves,
                        r.flips, r.rounds, r.outside_before, r.outside_after));
    }
    compare_with_surface(input, made.mesh, quality.volume_A3, !o.no_distance, j, lines, session);
    seconds["measure"] = clock.lap();
    write_tets(made.mesh, o.out, session.stage("writing"));
    if (!o.histogram.empty()) write_dihedral_histogram({{method, quality}}, o.histogram, o.plots.theme());
    session.end_stage();
    seconds["write"] = clock.lap();
    j["seconds"] = seconds;
    j["peak_bytes"] = peak_bytes();
    if (!session.json)
        for (const std::string& line : lines) session.say(line);
    if (quality.inverted > 0)
        session.warn(
            fmt::format("{}: {} tetrahedra have no volume, or are turned over", o.out, quality.inverted));
    session.result(j);
}

TetSource source_of(const TetrahedralizeOptions& o) {
    return is_mesh_input(o.in) ? TetSource::mesh : o.labels.empty() ? TetSource::map : TetSource::labels;
}

void run_compare(const TetrahedralizeOptions& o, const CLI::App& flags, Session& session) {
    if (o.in == "-") throw UsageError("--compare reads its input four times: give a file");
    const std::filesystem::path folder(o.out);
    std::error_code error;
    const bool made = std::filesystem::create_directory(folder, error);
    if (error || !std::filesystem::is_directory(folder))
        throw IoError(fmt::format("{}: the folder for the comparison cannot be made: {}", o.out,
                                  error ? error.message() : "there is a file of that name"));
    std::vector<MethodRun> runs;
    const Progress progress = session.stage("comparing");
    for (const std::string& method : tet_methods()) {
        if (source_of(o) == TetSource::labels && method == "stuffing") continue;
        const double done = static_cast<double>(runs.size()) / static_cast<double>(tet_methods().size());
        runs.push_back(run_method(o.in, method, (folder / (method + ".vtu")).string(),
                                  o.tets.words_of(flags, method), session,
                                  progress.part(0.9 * done, 0.9 * done + 0.2)));
    }
    const bool any =
        std::any_of(runs.begin(), runs.end(), [](const MethodRun& r) { return r.error.empty(); });
    if (!any) {
        if (made) std::filesystem::remove(folder, error);
        throw NumericalError(fmt::format("{}: no method succeeded: {}", o.in, runs.front().error));
    }
    write_file(folder / "comparison.csv", comparison_csv(runs));
    if (can_render())
        draw_comparison(runs, std::filesystem::path(o.in).filename().string(),
                        (folder / "comparison.png").string(), progress.part(0.9, 1));
    else
        session.warn("no picture: this build has no ray caster (embree)");
    session.end_stage();
    if (!session.json)
        for (const std::string& line : comparison_text(runs)) session.say(line);
    Json j;
    for (const MethodRun& run : runs) {
        Json row{{"method", run.method}, {"seconds_in_all", run.wall_seconds}};
        if (run.error.empty())
            row.update(run.result), row["file"] = run.file;
        else
            row["error"] = run.error;
        j["methods"].push_back(row);
    }
    session.result(j);
}

void check_flags(TetrahedralizeOptions& o, const CLI::App& flags) {
    o.map.finish();
    o.tets.finish(flags);
    check_plot_output(o.histogram);
    o.plots.check(!o.histogram.empty(), "--histogram");
    check_usage(o.filter);
    if (o.compare) {
        refuse_flags(flags, {"--method"}, "--compare runs all methods");
        refuse_flags(flags, {"--histogram"}, "belongs to one method, not to --compare");
    } else if (!is_tet_ending(o.out)) {
        throw UsageError(fmt::format("{}: the ending tells the format: {}", o.out, tet_endings_text()));
    }
    if (!o.labels.empty()) {
        o.wanted = parse_labels(o.labels);
        refuse_flags(flags, {"--iso", "--keep-largest", "--min-volume"}, "means nothing with --labels");
    }
    if (is_mesh_input(o.in)) refuse_flags(flags, {"--iso", "--labels"}, "belongs to a map, not to a mesh");
    if (!o.compare) o.tets.refuse_others(flags, o.tets.method_for(source_of(o)));
}

}  // namespace

Command tetrahedralize_command() {
    return {"tetrahedralize",
            "Fill the surface of a map, the labels of a segmentation, or a closed mesh with tetrahedra",
            "  vdbgeo tetrahedralize emd_1080.map groel.vtu --iso 0.8 --optimize\n"
            "  vdbgeo tetrahedralize groel.ply groel.msh --method tetgen --radius-edge 1.2\n"
            "  vdbgeo tetrahedralize emd_1080.map groel-methods --iso 0.8 --compare",
            [](CLI::App& app) {
                auto o = std::make_shared<TetrahedralizeOptions>();
                app.add_option("in", o->in,
                               "Map (MRC, CCP4), VDB grid, or closed mesh: " + mesh_endings_text())
                    ->required();
                app.add_option("out", o->out,
                               "Tetrahedra to write: " + tet_endings_text() +
                                   "; with --compare a folder for a table, a picture and the meshes")
                    ->required();
                o->iso.add(app);
                app.add_option(
                    "--labels", o->labels,
                    "The map is a segmentation: fill all its labels, or a list such as 1,2,5, a region "
                    "each");
                app.add_flag("--compare", o->compare, "Run all methods: a table and a picture of cutaways");
                o->tets.add(app);
                app.add_option("--keep-largest", o->filter.keep_largest,
                               "Keep this many pieces, the largest [all]");
                app.add_option("--min-volume", o->filter.min_volume_A3,
                               "Drop pieces of less than this volume, in Å³")
                    ->capture_default_str();
                app.add_flag("--no-distance", o->no_distance,
                             "Do not measure how far the boundary is from the surface");
                app.add_option("--histogram", o->histogram,
                               "Plot the histogram of the dihedral angles here (PNG or SVG)");
                o->plots.add(app);
                o->map.add_reading(app);
                o->map.add_sparsify(app);
                return [o, flags = &app](Session& session) {
                    check_flags(*o, *flags);
                    if (o->compare)
                        run_compare(*o, *flags, session);
                    else
                        run_tetrahedralize(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
