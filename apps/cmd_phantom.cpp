// vdbgeo phantom: analytic shapes and simulated specimens, with the truth beside them.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "apps/stages.h"

namespace vdbgeo::app {
namespace {

struct PhantomCommandOptions {
    PhantomOptions phantom;
    std::string out, truth;
    VdbWriteOptions vdb;
};

std::string kinds_text() {
    std::string text = "One of";
    for (const PhantomKind& kind : phantom_kinds()) text += " " + kind.name;
    return text;
}

void run_phantom(const PhantomCommandOptions& o, Session& session) {
    check_map_output(o.out, session);
    if (!o.truth.empty()) check_map_output(o.truth, session);
    if (o.truth == o.out) throw UsageError(fmt::format("{}: --truth needs a file of its own", o.truth));
    const Phantom phantom(o.phantom, session.stage("preparing"));
    const DensityMap map = phantom_map(phantom, false, session.stage("evaluating"));
    write_map(map, o.out, o.vdb, {}, session.stage("writing"));
    if (!o.truth.empty())
        write_map(phantom_map(phantom, true, session.stage("truth")), o.truth, o.vdb, {},
                  session.stage("writing"));
    session.end_stage();
    Json j{{"kind", o.phantom.kind},
           {"out", o.out},
           {"isovalue", phantom.isovalue()},
           {"noise_sigma", phantom.noise_sigma()}};
    j.update(grid_json(map));
    if (!session.json && !session.quiet)
        session.say(fmt::format("{}: {} of {}³ voxels of {:.4g} Å, surface at {}, noise {:.4g}", o.out,
                                o.phantom.kind, o.phantom.size, map.frame.voxel_size().x(),
                                phantom.isovalue(), phantom.noise_sigma()));
    session.result(j);
}

}  // namespace

Command phantom_command() {
    std::string kinds;
    for (const PhantomKind& kind : phantom_kinds())
        kinds += fmt::format("\n  {:<15} {}", kind.name, kind.description);
    return {"phantom", "Make a specimen with a known truth: analytic shapes, simulated complexes, noise",
            "  vdbgeo phantom atpase atpase.mrc --size 200 --snr 1 --truth clean.mrc\nKinds:" + kinds,
            [](CLI::App& app) {
                auto o = std::make_shared<PhantomCommandOptions>();
                PhantomOptions& p = o->phantom;
                app.add_option("kind", p.kind, kinds_text())->required();
                app.add_option("out", o->out, "Map to write: .mrc .map .ccp4 .rec or .vdb")->required();
                app.add_option("--size", p.size, "Samples along each axis")->capture_default_str();
                app.add_option("--voxel-size", p.voxel_size,
                               "Voxel size in Å [the specimen fills 80 % of the box]");
                app.add_option("--radius", p.radius,
                               "Radius in Å of sphere, torus, cylinder, saddle, catenoid");
                app.add_option("--minor-radius", p.minor_radius, "Tube radius in Å of the torus");
                app.add_option("--height", p.height, "Height in Å of the cylinder");
                app.add_option("--period", p.period, "Period in Å of the gyroid");
                app.add_option("--snr", p.snr,
                               "Variance inside the particle over the variance of the noise [no noise]");
                app.add_option("--seed", p.seed, "Seed of the noise")
                    ->check(CLI::NonNegativeNumber.description(""))
                    ->capture_default_str();
                app.add_option("--truth", o->truth, "Write the map without noise here too");
                add_vdb_flags(app, o->vdb);
                return [o](Session& session) {
                    check_usage(o->phantom);
                    run_phantom(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
