// vdbgeo components: the pieces of a mesh, listed, kept, dropped or split.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"

namespace vdbgeo::app {
namespace {

struct ComponentsOptions {
    std::string in, out;
    bool split = false;
    std::size_t list = 20;
    ComponentFlags flags;
};

Json component_json(const MeshComponent& c) {
    return {{"vertices", c.vertices},
            {"faces", c.faces},
            {"area_A2", c.area_A2},
            {"volume_A3", c.volume_A3 ? Json(*c.volume_A3) : Json()},
            {"cavity", c.cavity()},
            {"touches_border", c.touches_border},
            {"centroid_A", to_json(c.centroid)}};
}

std::string component_text(std::size_t number, const MeshComponent& c) {
    return fmt::format("{:>6}  {:>9} faces  {:>12.6g} Å²  {:>12}  {}{}", number, c.faces, c.area_A2,
                       c.volume_A3 ? fmt::format("{:.6g} Å³", *c.volume_A3) : "open",
                       c.cavity() ? "cavity" : "shell", c.touches_border ? ", touches the border" : "");
}

void run_components(const ComponentsOptions& o, Session& session) {
    if (!o.out.empty()) check_mesh_output(o.out);
    if (o.out.empty() && o.split) throw UsageError("--split needs a name for the meshes to write");
    TriMesh mesh = read_mesh(o.in, session.stage("reading"));
    if (o.flags.any())
        mesh = naming(o.in, [&] { return filter_components(mesh, o.flags.filter, session.stage("pieces")); });
    const MeshComponents pieces = mesh_components(mesh, session.stage("pieces"));
    session.end_stage();
    std::uint64_t cavities = 0;
    for (const MeshComponent& c : pieces.components) cavities += c.cavity();
    Json rows = Json::array();
    std::vector<std::string> lines;
    for (const MeshComponent& c : pieces.components) {
        if (rows.size() == o.list) break;
        lines.push_back(component_text(rows.size() + 1, c));
        rows.push_back(component_json(c));
    }
    Json j{{"components", pieces.components.size()}, {"cavities", cavities}, {"listed", rows}};
    lines.push_back(fmt::format("{} pieces, {} of them walls of cavities{}", pieces.components.size(),
                                cavities,
                                pieces.components.size() > rows.size() ? "; the largest are listed" : ""));
    if (o.split)
        j["files"] = write_pieces(mesh, o.out, session.stage("writing"));
    else if (!o.out.empty())
        write_mesh(mesh, o.out, {}, session.stage("writing"));
    session.end_stage();
    if (!session.json)
        for (const std::string& line : lines) session.say(line);
    session.result(j);
}

}  // namespace

Command components_command() {
    return {"components", "List the pieces of a mesh, keep or drop some, or split it into files",
            "  vdbgeo components groel.ply\n  vdbgeo components groel.ply clean.ply --min-volume 500",
            [](CLI::App& app) {
                auto o = std::make_shared<ComponentsOptions>();
                app.add_option("in", o->in, "Mesh: " + mesh_endings_text())->required();
                app.add_option("out", o->out, "Mesh to write [none]: " + mesh_endings_text());
                o->flags.add(app);
                app.add_flag("--split", o->split,
                             "One file a piece, the largest first: OUT_0001.ply and so on");
                app.add_option("--list", o->list, "List this many pieces, the largest first")
                    ->check(CLI::NonNegativeNumber.description(""))
                    ->capture_default_str();
                return [o](Session& session) {
                    check_usage(o->flags.filter);
                    run_components(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
