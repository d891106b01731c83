// vdbgeo smooth: a mesh without its noise, and of the same volume.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/mesh_command.h"
#include "vdbgeo/measure/requirements.h"
#include "vdbgeo/remesh/mesh_diffusion.h"
#include "vdbgeo/remesh/taubin_smooth.h"

namespace vdbgeo::app {
namespace {

struct SmoothOptions {
    MeshCommandFlags files;
    std::string method = "taubin";
    TaubinOptions taubin;
    MeshDiffusionOptions diffusion;
};

void run_smooth(const SmoothOptions& o, Session& session) {
    run_mesh_command(o.files, "smoothing", session, [&o](const MeshWork& work) {
        MeshRequirements needed;
        needed.manifold = true;
        require(work.before, needed, "smooth");
        work.json["method"] = o.method;
        if (work.before.volume_A3) work.json["volume_before_A3"] = *work.before.volume_A3;
        return o.method == "diffusion" ? mesh_diffusion(work.in, o.diffusion, work.progress)
                                       : taubin_smooth(work.in, o.taubin, work.progress);
    });
}

}  // namespace

Command smooth_command() {
    return {
        "smooth", "Smooth a mesh without shrinking it: Taubin's filter, or surface diffusion",
        "  vdbgeo smooth groel.ply smooth.ply --iterations 20\n"
        "  vdbgeo smooth groel.ply round.ply --method diffusion --time 10",
        [](CLI::App& app) {
            auto o = std::make_shared<SmoothOptions>();
            o->files.add(app, true);
            app.add_option("--method", o->method,
                           "taubin (fast) or diffusion (the flow x_t = -Lap(2H) n, keeps the volume)")
                ->check(CLI::IsMember({"taubin", "diffusion"}).description(""))
                ->capture_default_str();
            app.add_option("--iterations", o->taubin.iterations, "taubin: rounds, 0 for none")
                ->capture_default_str();
            app.add_option("--lambda", o->taubin.lambda, "taubin: step of the smoothing pass, 0 to 1")
                ->capture_default_str();
            app.add_option("--pass-band", o->taubin.pass_band,
                           "taubin: frequency that passes unchanged, 1/lambda + 1/mu")
                ->capture_default_str();
            app.add_option("--time", o->diffusion.time, "diffusion: time, in Å^4")->capture_default_str();
            app.add_option("--steps", o->diffusion.steps, "diffusion: implicit steps")->capture_default_str();
            return [o, flags = &app](Session& session) {
                if (o->method == "diffusion")
                    refuse_flags(*flags, {"--iterations", "--lambda", "--pass-band"},
                                 "belongs to --method taubin");
                else
                    refuse_flags(*flags, {"--time", "--steps"}, "belongs to --method diffusion");
                check_usage(o->taubin);
                check_usage(o->diffusion);
                if (o->method == "diffusion" && o->diffusion.time == 0)
                    throw UsageError("--method diffusion needs --time");
                run_smooth(*o, session);
            };
        }};
}

}  // namespace vdbgeo::app
