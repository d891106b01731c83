// vdbgeo simplify: the same surface with fewer triangles.
#include <fmt/format.h>

#include <cmath>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/mesh_command.h"
#include "vdbgeo/measure/requirements.h"
#include "vdbgeo/remesh/simplify.h"

namespace vdbgeo::app {
namespace {

struct SimplifyFlags {
    MeshCommandFlags files;
    SimplifyOptions options;
    std::optional<double> ratio;
};

void run_simplify(const SimplifyFlags& o, Session& session) {
    run_mesh_command(o.files, "simplifying", session, [&o](const MeshWork& work) {
        MeshRequirements needed;
        needed.manifold = needed.oriented = true;
        require(work.before, needed, "simplify");
        SimplifyOptions options = o.options;
        if (o.ratio)
            options.faces =
                static_cast<std::uint64_t>(std::llround(*o.ratio * static_cast<double>(work.before.faces)));
        if (options.faces) work.json["faces_asked"] = *options.faces;
        if (options.max_distance) work.json["max_distance_A"] = *options.max_distance;
        return simplify(work.in, options, work.progress);
    });
}

}  // namespace

Command simplify_command() {
    return {"simplify", "Make a mesh of fewer triangles, to a number or as far as an error bound allows",
            "  vdbgeo simplify groel.ply small.ply --ratio 0.1\n"
            "  vdbgeo simplify groel.ply near.ply --max-distance 1",
            [](CLI::App& app) {
                auto o = std::make_shared<SimplifyFlags>();
                o->files.add(app, true);
                app.add_option("--faces", o->options.faces, "Stop at this many faces");
                app.add_option("--ratio", o->ratio, "Stop at this part of the faces, from 0 to 1")
                    ->check(CLI::Range(0.0, 1.0));
                app.add_option("--max-distance", o->options.max_distance,
                               "Largest distance between input and result, measured both ways, in Å");
                return [o](Session& session) {
                    if (o->options.faces && o->ratio)
                        throw UsageError("--faces and --ratio both say how many");
                    if (o->ratio && std::isnan(*o->ratio)) throw UsageError("--ratio: not a number");
                    SimplifyOptions asked = o->options;
                    if (o->ratio) asked.faces = 1;
                    check_usage(asked);
                    run_simplify(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
