// vdbgeo pockets: where a surface curves inward, or outward.
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <set>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/measure/adaptive_curvature.h"
#include "vdbgeo/measure/pockets.h"
#include "vdbgeo/measure/vertex_areas.h"
#include "vdbgeo/view/png.h"
#include "vdbgeo/view/render.h"

namespace vdbgeo::app {
namespace {

struct PocketsCommandOptions {
    std::string in, out, mesh, picture;
    bool protrusions = false, recompute = false;
    std::size_t list = 20;
    PocketOptions pockets;
    RenderOptions render;

    const char* kind() const { return protrusions ? "protrusion" : "pocket"; }
};

/// One number of a patch in tables: its name with the unit, as text for CSV and JSON.
struct Column {
    const char* name;
    Json (*value)(const Pocket&);
};

constexpr Column columns[] = {
    {"id", [](const Pocket& p) { return Json(p.id); }},
    {"vertices", [](const Pocket& p) { return Json(p.vertices); }},
    {"area_A2", [](const Pocket& p) { return Json(p.area_A2); }},
    {"centroid_x_A", [](const Pocket& p) { return Json(p.centroid.x()); }},
    {"centroid_y_A", [](const Pocket& p) { return Json(p.centroid.y()); }},
    {"centroid_z_A", [](const Pocket& p) { return Json(p.centroid.z()); }},
    {"mean_k1_per_A", [](const Pocket& p) { return Json(p.mean_k1); }},
    {"mean_k2_per_A", [](const Pocket& p) { return Json(p.mean_k2); }},
    {"mean_H_per_A", [](const Pocket& p) { return Json(p.mean_H); }},
    {"mean_K_per_A2", [](const Pocket& p) { return Json(p.mean_K); }},
    {"extreme_k_per_A", [](const Pocket& p) { return Json(p.extreme_k); }},
    {"extreme_vertex", [](const Pocket& p) { return Json(p.extreme_vertex); }},
    {"depth_A", [](const Pocket& p) { return Json(p.depth_A); }},
    {"mean_depth_A", [](const Pocket& p) { return Json(p.mean_depth_A); }},
    {"rims", [](const Pocket& p) { return Json(p.rims); }},
    {"mouth_length_A", [](const Pocket& p) { return Json(p.mouth_length_A); }},
    {"mouth_area_A2", [](const Pocket& p) { return Json(p.mouth_area_A2); }},
    {"opening_x", [](const Pocket& p) { return Json(p.opening.x()); }},
    {"opening_y", [](const Pocket& p) { return Json(p.opening.y()); }},
    {"opening_z", [](const Pocket& p) { return Json(p.opening.z()); }},
    {"touches_border", [](const Pocket& p) { return Json(p.touches_border); }},
    {"score", [](const Pocket& p) { return Json(p.score); }},
};

Json pocket_json(const Pocket& p, const char* kind) {
    Json row;
    for (const Column& c : columns) {
        row[c.name] = c.value(p);
        if (c.name == columns[0].name) row["kind"] = kind;
    }
    return row;
}

/// null where there is no number.
Json finite_json(double value) { return std::isfinite(value) ? Json(value) : Json(); }

/// The rows of a table under their names.
struct Table {
    Json names = Json::array(), rows = Json::array();
};

/// One row a patch; beside the columns above the mean over the patch of every other value that the mesh has
/// at its vertices, as mean_NAME (NAME_mean where that is taken).
Table table_of(const Pockets& found, const TriMesh& mesh, const char* kind) {
    static const std::set<std::string> known{
        "K", "H", "k1", "k2", "shape_index", "curvedness", "type", "curvature_flags", "pocket", "protrusion"};
    Table table;
    const Json blank = pocket_json({}, kind);
    for (const auto& item : blank.items()) table.names.push_back(item.key());
    for (const Pocket& p : found.list) table.rows.push_back(pocket_json(p, kind));
    const Array<double> areas = found.list.empty() ? Array<double>(found.id.size()) : vertex_areas(mesh);
    for (const MeshProperty& p : mesh.vertex_properties) {
        if (p.components != 1 || known.count(p.name)) continue;
        const std::string name = blank.contains("mean_" + p.name) ? p.name + "_mean" : "mean_" + p.name;
        const std::vector<double> means = means_over(found, p.values, areas);
        table.names.push_back(name);
        for (std::size_t i = 0; i < means.size(); ++i) table.rows[i][name] = finite_json(means[i]);
    }
    return table;
}

/// Quoted where the text would be taken for several fields.
std::string csv_field(const std::string& text) {
    if (text.find_first_of(",\"\n") == std::string::npos) return text;
    std::string quoted = "\"";
    for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
    return quoted + "\"";
}

/// A value that is none is an empty field.
std::string csv(const Table& table) {
    std::string text;
    for (const Json& name : table.names)
        text += (text.empty() ? "" : ",") + csv_field(name.get<std::string>());
    for (const Json& row : table.rows) {
        std::string line;
        for (const Json& value : row)
            line += (line.empty() ? "" : ",") + (value.is_string() ? csv_field(value.get<std::string>())
                                                 : value.is_null() ? ""
                                                                   : value.dump());
        text += "\n" + line;
    }
    return text + "\n";
}

Json bounds_json(const PocketsCommandOptions& o, const Pockets& found) {
    Json j{{"kind", o.kind()}, {"threshold_per_A", found.threshold}};
    if (!o.protrusions) j["k1_below_per_A"] = finite_json(found.k1_below);
    j["min_area_A2"] = found.min_area;
    j["min_persistence_per_A"] = finite_json(found.min_persistence);
    j["depth_below"] = o.pockets.ambient_radius ? "ball" : "hull";
    j["ambient_radius_A"] = o.pockets.ambient_radius ? Json(*o.pockets.ambient_radius) : Json();
    double area = 0;
    for (const Pocket& p : found.list) area += p.area_A2;
    j[fmt::format("{}s", o.kind())] = found.list.size();
    j["area_A2"] = area;
    j["surface_area_A2"] = found.area_A2;
    return j;
}

/// From the mesh's own k1 and k2, where it has both.
std::optional<Curvatures> own_curvature(const TriMesh& mesh) {
    const MeshProperty *k1 = mesh.find_vertex_property("k1"), *k2 = mesh.find_vertex_property("k2");
    if (!k1 || !k2 || k1->components != 1 || k2->components != 1) return {};
    Curvatures c;
    c.resize(mesh.points.size(), false);
    c.flags = curvature_flags(mesh, "curvature");
    for (std::size_t v = 0; v < c.size(); ++v) {
        const double a = k1->values[v], b = k2->values[v];
        if (c.defined(v) && std::isfinite(a) && std::isfinite(b))
            c.set_from_principal(v, a, b);
        else
            c.set_undefined(v);
    }
    return c;
}

MeshProperty id_property(const Pockets& found, const char* name, float none) {
    MeshProperty property{name, 1, std::vector<float>(found.id.size())};
    for (std::size_t v = 0; v < found.id.size(); ++v)
        property.values[v] = found.id[v] ? static_cast<float>(found.id[v]) : none;
    return property;
}

Image picture(const PocketsCommandOptions& o, const TriMesh& mesh, const Pockets& found,
              const Progress& progress) {
    TriMesh shown;
    shown.points = mesh.points;
    shown.triangles = mesh.triangles;
    shown.vertex_properties = {id_property(found, o.kind(), std::numeric_limits<float>::quiet_NaN())};
    RenderOptions options = o.render;
    options.property = o.kind();
    options.colormap = "categorical";
    options.label = fmt::format("{}s by rank", o.kind());
    return render(shown, options, progress);
}

std::string line_of(const Pocket& p) {
    return fmt::format(
        "{:>6}  {:>10.4g} Å²  {:>7.4g} Å deep  mouth {:>8.4g} Å²  k {:>8.3g}/Å  at {:.1f} {:.1f} {:.1f}{}",
        p.id, p.area_A2, p.depth_A, p.mouth_area_A2, p.extreme_k, p.centroid.x(), p.centroid.y(),
        p.centroid.z(), p.touches_border ? ", at the border" : "");
}

void check_outputs(const PocketsCommandOptions& o, Session& session) {
    if (o.out == "-")
        take_output(session);
    else if (!has_ending(o.out, ".csv") && !has_ending(o.out, ".json"))
        throw UsageError(fmt::format("{}: tables are .csv or .json files", o.out));
    if (!o.mesh.empty()) check_mesh_output(o.mesh);
    for (const std::string& path : {o.out, o.mesh, o.picture}) check_folder_of(path);
    if (o.picture.empty()) return;
    if (!has_ending(o.picture, ".png"))
        throw UsageError(fmt::format("{}: pictures are PNG files: .png", o.picture));
    if (!can_render()) throw UsageError("--picture needs a build with embree, which casts the rays");
}

void run_pockets(const PocketsCommandOptions& o, Session& session) {
    check_outputs(o, session);
    Json seconds;
    Clock clock;
    TriMesh mesh = read_mesh(o.in, session.stage("reading"));
    seconds["read"] = clock.lap();
    bool own = false;
    const Curvatures curvature = naming(o.in, [&]() -> Curvatures {
        std::optional<Curvatures> c;
        if (!o.recompute) c = own_curvature(mesh);
        own = c.has_value();
        return own ? std::move(*c) : adaptive_curvature(mesh, {}, session.stage("curvature"));
    });
    seconds["curvature"] = clock.lap();
    const Pockets found =
        naming(o.in, [&] { return find_pockets(mesh, curvature, o.pockets, session.stage("patches")); });
    seconds["patches"] = clock.lap();
    Image image;
    if (!o.picture.empty())
        image = naming(o.in, [&] { return picture(o, mesh, found, session.stage("rendering")); });
    const Table table = table_of(found, mesh, o.kind());
    Json rows = table.rows;
    Json j{{"file", o.in}, {"curvature", own ? "of the file" : "computed"}};
    j.update(bounds_json(o, found));
    Json all = j;
    all["list"] = rows;
    if (!o.mesh.empty()) {
        TriMesh marked = std::move(mesh);
        set_vertex_property(marked, id_property(found, o.kind(), 0));
        write_mesh(marked, o.mesh, {}, session.stage("writing"));
    }
    if (!o.picture.empty()) write_png(image, o.picture);
    write_file(o.out, has_ending(o.out, ".json") ? json_text(all, 1) + "\n" : csv(table));
    seconds["write"] = clock.lap();
    session.end_stage();
    rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(std::min(o.list, rows.size())), rows.end());
    j["listed"] = rows;
    j["seconds"] = seconds;
    if (!session.json) {
        for (std::size_t i = 0; i < std::min(o.list, found.list.size()); ++i)
            session.say(line_of(found.list[i]));
        const std::string bounds = o.protrusions ? fmt::format("k1 above {:.4g}/Å", found.threshold)
                                                 : fmt::format("k2 below {:.4g}/Å, k1 not above {:.4g}/Å",
                                                               found.threshold, found.k1_below);
        session.say(fmt::format("{} {}s ({}), {:.3g} % of the surface; curvature {}", found.list.size(),
                                o.kind(), bounds,
                                found.area_A2 > 0 ? 100 * j["area_A2"].get<double>() / found.area_A2 : 0.0,
                                own ? "of the file" : "computed"));
    }
    session.result(j);
}

}  // namespace

Command pockets_command() {
    return {"pockets",
            "Find where a surface curves inward (possible binding sites) or, with --protrusions, outward",
            "  vdbgeo pockets groel.ply pockets.csv --picture pockets.png\n"
            "  vdbgeo pockets groel.ply tips.json --protrusions",
            [](CLI::App& app) {
                auto o = std::make_shared<PocketsCommandOptions>();
                PocketOptions& p = o->pockets;
                app.add_option("in", o->in, "Mesh: " + mesh_endings_text())->required();
                app.add_option("out", o->out, "Table to write: .csv or .json, - for CSV on standard output")
                    ->required();
                auto* protrusions =
                    app.add_flag("--protrusions", o->protrusions, "Patches of large k1 in place of pockets");
                app.add_option("--k2-below", p.k2_below,
                               "Pockets: k2 under this, in 1/Å [-c/2, c the median curvedness by area]")
                    ->excludes(protrusions);
                app.add_option("--k1-below", p.k1_below,
                               "Pockets: and k1 not above this, in 1/Å; inf: no bound [c]")
                    ->excludes(protrusions);
                app.add_option("--k1-above", p.k1_above, "Protrusions: k1 above this, in 1/Å [2 c or less]")
                    ->needs(protrusions);
                app.add_option(
                    "--min-area", p.min_area,
                    "Drop smaller patches, in Å² [20 vertices', or 1/s², s the larger of |bound| and c]");
                app.add_option("--min-persistence", p.min_persistence,
                               "Part patches at saddles of this depth in curvature, in 1/Å; inf: never [s]");
                app.add_option("--ambient-radius", p.ambient_radius,
                               "Depth below what a ball of this radius rolls on, in Å [the convex hull]");
                app.add_flag("--recompute", o->recompute, "Ignore k1 and k2 of the mesh's vertices");
                app.add_option("--list", o->list, "List this many, the first by rank")
                    ->check(CLI::NonNegativeNumber.description(""))
                    ->capture_default_str();
                app.add_option("--mesh", o->mesh,
                               "Mesh to write, with the vertex property pocket (or protrusion): the id, 0 "
                               "for none [none]");
                auto* picture =
                    app.add_option("--picture", o->picture, "PNG to write: the patches in colours [none]");
                app.add_option("--width", o->render.width, "Width of the picture in pixels")
                    ->capture_default_str()
                    ->needs(picture);
                app.add_option("--view", o->render.view, "Of the picture: three, front, side, top or iso")
                    ->capture_default_str()
                    ->needs(picture);
                return [o](Session& session) {
                    o->pockets.kind = o->protrusions ? PatchKind::protrusion : PatchKind::pocket;
                    check_usage(o->pockets);
                    check_usage(o->render);
                    run_pockets(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
