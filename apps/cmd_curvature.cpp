// vdbgeo curvature: curvature at the vertices of a mesh.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>

#include "apps/command.h"
#include "apps/curvature_report.h"
#include "apps/flags.h"
#include "apps/plots.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "vdbgeo/measure/adaptive_curvature.h"
#include "vdbgeo/measure/curvature_tensor.h"
#include "vdbgeo/measure/discrete_curvature.h"
#include "vdbgeo/measure/field_curvature.h"
#include "vdbgeo/measure/jet_curvature.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/normal_voting.h"
#include "vdbgeo/measure/shape_types.h"
#include "vdbgeo/measure/vertex_areas.h"
#include "vdbgeo/measure/vertex_samples.h"

namespace vdbgeo::app {
namespace {

struct CurvatureOptions {
    std::string in, out, map, method = "auto";
    std::string table, histogram, plane;
    PlotFlags plots;
    std::optional<double> radius, flatness;
    DiscreteCurvatureOptions discrete;
    CurvatureTensorOptions tensor;
    JetOptions jets;
    NormalVotingOptions voting;
    AdaptiveCurvatureOptions adaptive;
    FieldCurvatureOptions field;
    std::vector<std::string> samples;
    VertexSampleOptions sampling;
    MapFlags map_flags;

    std::string chosen() const { return method != "auto" ? method : map.empty() ? "adaptive" : "field"; }
};

/// The flags that belong to some methods only.
const std::vector<std::pair<std::string, std::vector<std::string>>>& owners() {
    static const std::vector<std::pair<std::string, std::vector<std::string>>> table{
        {"--area", {"discrete"}},
        {"--neighbourhood", {"tensor"}},
        {"--radius", {"adaptive", "tensor", "jets", "voting"}},
        {"--degree", {"jets"}},
        {"--rings", {"jets"}},
        {"--map", {"field"}},
        {"--scale", {"field"}}};
    return table;
}

/// NAME=MAP with a name that tables and mesh files can hold, and that curvature does not take.
void check_sample(const std::string& text) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
        throw UsageError(fmt::format("--sample {}: expected NAME=MAP", text));
    const std::string name = text.substr(0, equals);
    const auto plain = [](unsigned char c) { return std::isalnum(c) || c == '_'; };
    if (!std::all_of(name.begin(), name.end(), plain))
        throw UsageError(fmt::format("--sample {}: a name has letters, digits and _", text));
    static const char* const taken[] = {"K",
                                        "H",
                                        "k1",
                                        "k2",
                                        "type",
                                        "shape_index",
                                        "curvedness",
                                        "direction1",
                                        "direction1_x",
                                        "direction1_y",
                                        "direction1_z",
                                        "curvature_flags",
                                        "direction2",
                                        "x",
                                        "y",
                                        "z",
                                        "direction2_x",
                                        "direction2_y",
                                        "direction2_z"};
    if (std::find(std::begin(taken), std::end(taken), name) != std::end(taken))
        throw UsageError(fmt::format("--sample {}: {} is the curvature's own", text, name));
}

void finish(CurvatureOptions& o, const CLI::App& flags) {
    const std::string method = o.chosen();
    for (const auto& [flag, methods] : owners())
        if (std::find(methods.begin(), methods.end(), method) == methods.end())
            refuse_flags(flags, {flag}, "belongs to --method " + fmt::format("{}", fmt::join(methods, ", ")));
    if (method == "field" && o.map.empty()) throw UsageError("--method field needs --map");
    if (o.samples.empty()) refuse_flags(flags, {"--sample-offset", "--sample-mean"}, "belongs to --sample");
    o.tensor.radius = o.jets.radius = o.voting.radius = o.adaptive.radius = o.radius;
    check_usage(o.tensor);
    check_usage(o.jets);
    check_usage(o.voting);
    check_usage(o.adaptive);
    check_usage(o.field);
    check_usage(o.sampling);
    std::set<std::string> names;
    for (const std::string& s : o.samples) {
        check_sample(s);
        if (!names.insert(s.substr(0, s.find('='))).second)
            throw UsageError(fmt::format("--sample {}: a name is there twice", s));
    }
    if (o.map.empty() && o.samples.empty())
        refuse_flags(flags,
                     {"--voxel-size", "--origin", "--mode0", "--volume", "--crop", "--bin", "--invert",
                      "--normalise", "--grid"},
                     "belongs to --map and --sample");
    if (method == "jets" && o.radius) refuse_flags(flags, {"--rings"}, "means nothing with --radius");
    if (method == "tensor" && o.tensor.neighbourhood == TensorNeighbourhood::ring)
        refuse_flags(flags, {"--radius"}, "means nothing with --neighbourhood ring");
    if (o.flatness && !(*o.flatness >= 0)) throw UsageError("--flatness: expected 0 or more, in 1/Å");
    if (!o.table.empty() && !has_ending(o.table, ".csv"))
        throw UsageError(fmt::format("{}: tables are CSV files: .csv", o.table));
    check_plot_output(o.histogram);
    check_plot_output(o.plane);
    o.plots.check(!o.histogram.empty() || !o.plane.empty(), "--histogram and --plane");
    o.map_flags.finish();
}

/// The curvature by the chosen method, and the vertices' areas; what it chose goes into `j`.
Curvatures estimate(const CurvatureOptions& o, const TriMesh& mesh, Array<double>& areas, Json& j,
                    Session& session) {
    const std::string method = o.chosen();
    j["method"] = method;
    if (method == "field") {
        const MapFile in = read_map(o.map, o.map_flags.options, session.stage("reading the map"));
        for (const std::string& w : in.warnings) session.warn(o.map + ": " + w);
        FieldCurvatureOptions options = o.field;
        options.level_set = in.level_set;
        FieldCurvature c = field_curvature(mesh, in.map, options, session.stage("curvature"));
        j["scale_voxels"] = c.scale;
        return c;
    }
    const Progress progress = session.stage("curvature");
    if (o.radius) j["radius_A"] = *o.radius;
    if (method == "discrete") {
        DiscreteCurvature c = discrete_curvature(mesh, o.discrete, progress);
        areas = std::move(c.dual_area);
        return c;
    }
    if (method == "tensor") return tensor_curvature(mesh, o.tensor, progress);
    if (method == "jets") return jet_curvature(mesh, o.jets, progress);
    if (method == "voting") return voted_curvature(mesh, o.voting, progress);
    AdaptiveCurvature c = adaptive_curvature(mesh, o.adaptive, progress);
    j["radius_A"] = c.radius;
    return c;
}

std::vector<MeshProperty> sampled(const CurvatureOptions& o, const TriMesh& mesh, Session& session) {
    std::vector<MeshProperty> all;
    for (const std::string& s : o.samples) {
        const std::size_t equals = s.find('=');
        const std::string name = s.substr(0, equals), file = s.substr(equals + 1);
        const MapFile in = read_map(file, o.map_flags.options, session.stage("reading " + name));
        for (const std::string& w : in.warnings) session.warn(file + ": " + w);
        all.push_back(sample_at_vertices(mesh, in.map, name, o.sampling, session.stage("sampling")));
    }
    return all;
}

/// A mesh that encloses a negative volume has its faces turned inward; so has the wall of a cavity, but not
/// the whole. The field does not look at the faces.
void warn_where_inward(const TriMesh& mesh, const CurvatureOptions& o, Session& session) {
    if (o.chosen() == "field") return;
    const MeshMeasures m = measure_mesh(mesh);
    if (m.volume_A3 && *m.volume_A3 < 0)
        session.warn(
            fmt::format("{}: its faces are turned inward, so what bulges has a negative curvature; repair "
                        "turns them",
                        o.in));
}

void run_curvature(const CurvatureOptions& o, Session& session) {
    check_mesh_output(o.out);
    for (const std::string& path : {o.out, o.table, o.histogram, o.plane}) check_folder_of(path);
    for (const char* ending : {".obj", ".off", ".stl"})
        if (has_ending(o.out, ending))
            session.warn(
                fmt::format("{}: {} files hold no curvature; .ply, .vtp and .glb do", o.out, ending));
    Json seconds, j;
    Clock clock;
    TriMesh mesh = read_mesh(o.in, session.stage("reading"));
    seconds["read"] = clock.lap();
    warn_where_inward(mesh, o, session);
    Array<double> areas;
    const Curvatures curvature = naming(o.in, [&] { return estimate(o, mesh, areas, j, session); });
    if (areas.empty()) areas = vertex_areas(mesh);
    seconds["compute"] = clock.lap();
    if (curvature.size() > 0 && std::all_of(curvature.flags.begin(), curvature.flags.end(),
                                            [](std::uint8_t f) { return f & curvature_undefined; }))
        session.warn(
            fmt::format("{}: no vertex has a value: too few faces, or the map does not reach it", o.in));
    const double flatness = o.flatness ? *o.flatness : default_flatness(curvature, as_weights(areas));
    CurvatureReport report{mesh, curvature, std::move(areas), flatness, sampled(o, mesh, session)};
    j.update(curvature_json(report));
    seconds["report"] = clock.lap();
    attach(mesh, curvature, report.flatness);
    for (const MeshProperty& p : report.sampled) set_vertex_property(mesh, p);
    if (!o.table.empty()) write_curvature_table(report, o.table, session.stage("table"));
    if (!o.histogram.empty()) write_drawing(plot_curvature_histogram(report, o.plots.theme()), o.histogram);
    if (!o.plane.empty()) write_drawing(plot_curvature_plane(report, o.plots.theme()), o.plane);
    write_mesh(mesh, o.out, {}, session.stage("writing"));
    seconds["write"] = clock.lap();
    session.end_stage();
    j["seconds"] = seconds;
    if (!session.json) {
        session.say(fmt::format("method      {}{}", j["method"].get<std::string>(),
                                j.contains("radius_A")
                                    ? fmt::format(", neighbourhoods of {:.4g} Å", j["radius_A"].get<double>())
                                : j.contains("scale_voxels")
                                    ? fmt::format(", scale {:.3g} voxels", j["scale_voxels"].get<double>())
                                    : ""));
        for (const std::string& line : curvature_text(report)) session.say(line);
    }
    session.result(j);
}

void add_method_flags(CLI::App& app, CurvatureOptions& o) {
    app.add_option("--method", o.method,
                   "auto (field where there is a map, else adaptive), adaptive, field, jets, tensor, voting "
                   "or discrete")
        ->check(CLI::IsMember({"auto", "adaptive", "field", "jets", "tensor", "voting", "discrete"})
                    .description(""))
        ->capture_default_str();
    app.add_option("--map", o.map, "field: the map or grid that the mesh is the surface of");
    app.add_option("--scale", o.field.scale,
                   "field: the density is seen through a gaussian of this standard deviation, in voxels "
                   "[by the map]");
    app.add_option("--radius", o.radius,
                   "adaptive, tensor, jets, voting: size of the neighbourhood, in Å [by the mesh]");
    app.add_option("--degree", o.jets.degree, "jets: degree of the polynomial, 2 to 4")
        ->capture_default_str();
    app.add_option("--rings", o.jets.rings, "jets: vertices within this many edges, without --radius")
        ->capture_default_str();
    app.add_option("--neighbourhood", o.tensor.neighbourhood, "tensor: ring, ball or geodesic")
        ->transform(CLI::CheckedTransformer(std::map<std::string, TensorNeighbourhood>{
                                                {"ring", TensorNeighbourhood::ring},
                                                {"ball", TensorNeighbourhood::ball},
                                                {"geodesic", TensorNeighbourhood::geodesic}})
                        .description(""))
        ->default_str("ball");
    app.add_option("--area", o.discrete.area, "discrete: area of a vertex: barycentric, voronoi or mixed")
        ->transform(
            CLI::CheckedTransformer(std::map<std::string, DualArea>{{"barycentric", DualArea::barycentric},
                                                                    {"voronoi", DualArea::voronoi},
                                                                    {"mixed", DualArea::mixed}})
                .description(""))
        ->default_str("mixed");
}

}  // namespace

Command curvature_command() {
    return {
        "curvature", "Curvature, shape index and surface types at the vertices of a mesh",
        "  vdbgeo curvature groel.ply curved.ply --map emd_1080.map\n"
        "  vdbgeo curvature groel.ply curved.ply --table curved.csv --sample density=emd_1080.map\n"
        "  vdbgeo curvature groel.ply curved.ply --histogram k.svg --plane k1k2.svg",
        [](CLI::App& app) {
            auto o = std::make_shared<CurvatureOptions>();
            app.add_option("in", o->in, "Mesh: " + mesh_endings_text())->required();
            app.add_option("out", o->out,
                           "The mesh with its curvature as vertex properties: " + mesh_endings_text())
                ->required();
            add_method_flags(app, *o);
            app.add_option("--flatness", o->flatness,
                           "Principal curvatures up to this, in 1/Å, count as 0 for the surface types [by "
                           "the mesh]");
            app.add_option("--sample", o->samples,
                           "NAME=MAP: the map's value at each vertex, as a property and in the tables; may "
                           "be repeated");
            app.add_option("--sample-offset", o->sampling.offset,
                           "Sample this far outside along the normal (negative: inside), in Å")
                ->capture_default_str();
            app.add_option("--sample-mean", o->sampling.mean_over,
                           "Mean over this length along the normal, in Å; 0: one sample")
                ->capture_default_str();
            app.add_option("--table", o->table, "Write one line a vertex as CSV here");
            app.add_option("--histogram", o->histogram,
                           "Plot the distributions of k1, k2 and H over the area here (PNG or SVG)");
            app.add_option("--plane", o->plane,
                           "Plot the area over k1 and k2 with the surface types here (PNG or SVG)");
            o->plots.add(app);
            o->map_flags.add_reading(app);
            return [o, flags = &app](Session& session) {
                finish(*o, *flags);
                run_curvature(*o, session);
            };
        }};
}

}  // namespace vdbgeo::app
