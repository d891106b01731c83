// vdbgeo render: a picture of a mesh, or of a map's surface.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/view/png.h"

namespace vdbgeo::app {
namespace {

struct RenderCommandOptions {
    std::string in, out;
    MapFlags map;
    IsoFlag iso;
    RenderOptions render;
};

TriMesh load(const RenderCommandOptions& o, const Isovalue& rule, Session& session) {
    if (holds_tets(o.in)) return boundary_surface(read_tets(o.in, session.stage("reading")));
    if (is_mesh_input(o.in)) return read_mesh(o.in, session.stage("reading"));
    const MapFile in = read_map(o.in, o.map.options, session.stage("reading"));
    for (const std::string& w : in.warnings) session.warn(o.in + ": " + w);
    return extract_surface(o.in, in, rule, session.stage("surface")).mesh;
}

void run_render(const RenderCommandOptions& o, Session& session) {
    if (o.out != "-" && !has_ending(o.out, ".png"))
        throw UsageError(fmt::format("{}: pictures are PNG files: .png", o.out));
    if (o.out == "-") take_output(session);
    const Isovalue rule = o.iso.parse();
    Clock clock;
    const TriMesh mesh = load(o, rule, session);
    const auto progress = session.stage("rendering");
    const Image image = naming(o.in, [&] { return render(mesh, o.render, progress); });
    write_png(image, o.out);
    session.end_stage();
    session.result(
        {{"out", o.out}, {"width", image.width}, {"height", image.height}, {"seconds", clock.seconds()}});
}

}  // namespace

Command render_command() {
    return {"render", "Draw a mesh, or a map's surface at an isovalue, as a PNG; no display is needed",
            "  vdbgeo render groel.ply groel.png --view iso", [](CLI::App& app) {
                auto o = std::make_shared<RenderCommandOptions>();
                app.add_option("in", o->in,
                               "Mesh (" + mesh_endings_text() + "), tetrahedral mesh (" + tet_endings_text() +
                                   "; its boundary), map or VDB grid")
                    ->required();
                app.add_option("out", o->out, "Picture to write: .png")->required();
                add_render_flags(app, o->render);
                o->iso.add(app);
                o->map.add_reading(app);
                return [o](Session& session) {
                    o->map.finish();
                    check_usage(o->render);
                    run_render(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
