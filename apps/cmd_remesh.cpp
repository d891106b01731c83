// vdbgeo remesh: the same surface with better triangles.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/mesh_command.h"
#include "vdbgeo/measure/one_ring.h"
#include "vdbgeo/measure/requirements.h"
#include "vdbgeo/remesh/delaunay_remesh.h"
#include "vdbgeo/remesh/isotropic_remesh.h"
#include "vdbgeo/surface/delaunay_surface.h"

namespace vdbgeo::app {
namespace {

struct RemeshOptions {
    MeshCommandFlags files;
    std::string method = "isotropic";
    IsotropicRemeshOptions isotropic;
    CurvatureSizing sizing;
    DelaunayRemeshOptions delaunay;
    bool adaptive = false;
};

TriMesh by_delaunay(const RemeshOptions& o, const MeshWork& work) {
    require(work.before, {true, true, true, true}, "remesh --method delaunay");
    DelaunayRemeshOptions options = o.delaunay;
    const double edge = mean_edge(work.in);
    if (options.radius == 0) options.radius = edge;
    if (options.distance == 0) options.distance = edge / 2;
    work.json["radius_A"] = options.radius;
    work.json["distance_A"] = options.distance;
    return delaunay_remesh(work.in, options, work.progress);
}

TriMesh by_isotropic(const RemeshOptions& o, const MeshWork& work) {
    MeshRequirements needed;
    needed.manifold = needed.oriented = true;
    require(work.before, needed, "remesh");
    IsotropicRemeshOptions options = o.isotropic;
    const double edge = mean_edge(work.in);
    if (o.adaptive) {
        CurvatureSizing sizing = o.sizing;
        if (sizing.min_length == 0) sizing.min_length = edge / 2;
        if (sizing.max_length == 0) sizing.max_length = 4 * edge;
        if (sizing.error == 0) sizing.error = edge / 10;
        options.adaptive = sizing;
        work.json["min_length_A"] = sizing.min_length;
        work.json["max_length_A"] = sizing.max_length;
        work.json["error_A"] = sizing.error;
    } else {
        work.json["length_A"] = options.target_length.value_or(edge);
    }
    return isotropic_remesh(work.in, options, work.progress);
}

/// Flags of another method than the one that runs.
void refuse_others(const RemeshOptions& o, const CLI::App& app) {
    const std::vector<std::string> lengths{"--min-length", "--max-length", "--error"};
    if (o.method == "delaunay") {
        refuse_flags(app, {"--length", "--iterations", "--feature-angle", "--adaptive"},
                     "belongs to --method isotropic");
        if (!have_delaunay()) throw UsageError("--method delaunay: this build has no CGAL");
    } else {
        refuse_flags(app, {"--angle", "--radius", "--distance", "--max-vertices", "--max-seconds"},
                     "belongs to --method delaunay");
    }
    if (!o.adaptive) refuse_flags(app, lengths, "belongs to --adaptive");
    if (o.adaptive) refuse_flags(app, {"--length"}, "--adaptive has lengths of its own");
}

void run_remesh(const RemeshOptions& o, Session& session) {
    run_mesh_command(o.files, "remeshing", session, [&o](const MeshWork& work) {
        work.json["method"] = o.method == "isotropic" && o.adaptive ? "adaptive" : o.method;
        return o.method == "delaunay" ? by_delaunay(o, work) : by_isotropic(o, work);
    });
}

}  // namespace

Command remesh_command() {
    return {
        "remesh", "Make the triangles of a mesh well shaped: even, as fine as it is curved, or Delaunay",
        "  vdbgeo remesh groel.ply even.ply --length 3\n"
        "  vdbgeo remesh groel.ply curved.ply --adaptive --error 0.5",
        [](CLI::App& app) {
            auto o = std::make_shared<RemeshOptions>();
            o->files.add(app, true);
            app.add_option("--method", o->method,
                           "isotropic (split, collapse, flip, relax) or delaunay (needs a closed mesh)")
                ->check(CLI::IsMember({"isotropic", "delaunay"}).description(""))
                ->capture_default_str();
            app.add_option("--length", o->isotropic.target_length,
                           "isotropic: length of the edges, in Å [mean edge of the input]");
            app.add_option("--iterations", o->isotropic.iterations, "isotropic: rounds")
                ->capture_default_str();
            app.add_option("--feature-angle", o->isotropic.feature_angle_deg,
                           "isotropic: keep creases where faces turn by more than this, in degrees [none]");
            app.add_flag("--adaptive", o->adaptive, "isotropic: short edges where the surface is curved");
            app.add_option("--min-length", o->sizing.min_length,
                           "adaptive: shortest edges, in Å [half the mean edge of the input]");
            app.add_option("--max-length", o->sizing.max_length,
                           "adaptive: longest edges, in Å [4 times the mean edge of the input]");
            app.add_option("--error", o->sizing.error,
                           "adaptive: how far edges may leave the surface, in Å [a tenth of the mean edge]");
            app.add_option("--angle", o->delaunay.angle_deg, "delaunay: least angle, in degrees")
                ->capture_default_str();
            app.add_option("--radius", o->delaunay.radius,
                           "delaunay: largest radius of a triangle's surface ball, in Å [mean edge]");
            app.add_option("--distance", o->delaunay.distance,
                           "delaunay: largest distance from the input, in Å [half the mean edge]");
            app.add_option("--max-vertices", o->delaunay.max_vertices,
                           "delaunay: give up beyond this many vertices")
                ->capture_default_str();
            app.add_option("--max-seconds", o->delaunay.max_seconds,
                           "delaunay: give up after this time, in seconds")
                ->capture_default_str();
            return [o, flags = &app](Session& session) {
                refuse_others(*o, *flags);
                if (!o->adaptive && o->method == "isotropic") check_usage(o->isotropic);
                run_remesh(*o, session);
            };
        }};
}

}  // namespace vdbgeo::app
