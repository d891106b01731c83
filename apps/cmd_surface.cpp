// vdbgeo surface: the surface of a map at an isovalue.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"

namespace vdbgeo::app {
namespace {

struct SurfaceOptions {
    std::string in, out;
    MapFlags map;
    IsoFlag iso;
};

void run_surface(const SurfaceOptions& o, Session& session) {
    if (!is_mesh_ending(o.out))
        throw UsageError(fmt::format("{}: the ending tells the format: {}", o.out, mesh_endings_text()));
    const Isovalue rule = o.iso.parse();
    Json seconds;
    Clock clock;
    const MapFile in = read_map(o.in, o.map.options, session.stage("reading"));
    seconds["read"] = clock.lap();
    for (const std::string& w : in.warnings) session.warn(o.in + ": " + w);
    const Surface surface = extract_surface(o.in, in, rule, session.stage("surface"));
    const MeshMeasures measures = measure_mesh(surface.mesh, session.stage("measuring"));
    seconds["compute"] = clock.lap();
    write_mesh(surface.mesh, o.out, {}, session.stage("writing"));
    seconds["write"] = clock.lap();
    session.end_stage();
    Json j = measures_json(measures);
    j["iso"] = surface.isovalue;
    j["method"] = "marching-cubes";
    j["seconds"] = seconds;
    if (!session.json) {
        session.say(fmt::format("isovalue    {:.6g} ({})", surface.isovalue, rule.text()));
        for (const std::string& line : measures_text(measures)) session.say(line);
    }
    say_where_open(measures, session);
    session.result(j);
}

}  // namespace

Command surface_command() {
    return {"surface", "Extract the surface of a map or grid at an isovalue by marching cubes",
            "  vdbgeo surface emd_1080.map groel.ply --iso 0.8", [](CLI::App& app) {
                auto o = std::make_shared<SurfaceOptions>();
                app.add_option("in", o->in, "Map (MRC, CCP4) or VDB grid")->required();
                app.add_option("out", o->out, "Mesh to write: " + mesh_endings_text())->required();
                o->iso.add(app);
                o->map.add_reading(app);
                o->map.add_sparsify(app);
                return [o](Session& session) {
                    o->map.finish();
                    run_surface(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
