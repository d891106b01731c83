// vdbgeo repair: mends what can be mended in a mesh.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/mesh_command.h"
#include "vdbgeo/remesh/repair.h"

namespace vdbgeo::app {
namespace {

struct RepairFlags {
    MeshCommandFlags files;
    RepairOptions options;
};

Json report_json(const RepairReport& r) {
    return {{"merged_vertices", r.merged_vertices},
            {"unused_vertices", r.unused_vertices},
            {"degenerate_faces", r.degenerate_faces},
            {"duplicate_faces", r.duplicate_faces},
            {"split_vertices", r.split_vertices},
            {"flipped_faces", r.flipped_faces},
            {"filled_holes", r.filled_holes},
            {"open_holes", r.open_holes},
            {"intersecting_faces_before", r.intersecting_faces_before},
            {"intersecting_faces_after", r.intersecting_faces_after}};
}

void run_repair(const RepairFlags& o, Session& session) {
    run_mesh_command(o.files, "repairing", session, [&](const MeshWork& work) {
        RepairResult result = repair(work.in, o.options, work.progress);
        work.json["repaired"] = report_json(result.report);
        session.end_stage();
        if (!session.json)
            for (const auto& [what, count] : work.json["repaired"].items())
                if (count.get<std::uint64_t>() > 0) session.say(fmt::format("{:<27} {}", what, count.dump()));
        if (result.report.intersecting_faces_after > 0)
            session.warn(
                fmt::format("{} faces still cut each other", result.report.intersecting_faces_after));
        if (result.report.open_holes > 0)
            session.warn(fmt::format("{} holes are still open", result.report.open_holes));
        return std::move(result.mesh);
    });
}

}  // namespace

Command repair_command() {
    return {"repair",
            "Mend a mesh: holes, non-manifold edges and vertices, faces that are turned, double or cut each "
            "other",
            "  vdbgeo repair groel.ply sound.ply", [](CLI::App& app) {
                auto o = std::make_shared<RepairFlags>();
                o->files.add(app, false);
                app.add_flag("!--keep-holes", o->options.fill_holes, "Leave holes open");
                app.add_option("--max-hole", o->options.max_hole_edges, "Leave holes of more edges open")
                    ->capture_default_str();
                app.add_flag("!--keep-intersections", o->options.self_intersections,
                             "Leave faces that cut each other");
                return [o](Session& session) {
                    check_usage(o->options);
                    run_repair(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
