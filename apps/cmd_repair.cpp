// vdbgeo repair: mends what can be mended in a mesh.
#include <fmt/format.h>

#include <algorithm>

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

Json or_null(const std::optional<std::uint64_t>& count) { return count ? Json(*count) : Json(); }

Json report_json(const RepairReport& r) {
    return {{"merged_vertices", r.merged_vertices},
            {"degenerate_faces", r.degenerate_faces},
            {"duplicate_faces", r.duplicate_faces},
            {"flipped_faces", r.flipped_faces},
            {"flipped_pieces", r.flipped_pieces},
            {"split_vertices", r.split_vertices},
            {"filled_holes", r.filled_holes},
            {"open_holes", r.open_holes},
            {"added_faces", r.added_faces},
            {"unused_vertices", r.unused_vertices},
            {"intersecting_faces_before", or_null(r.intersecting_faces_before)},
            {"intersecting_faces_after", or_null(r.intersecting_faces_after)},
            {"moved_vertices", r.moved_vertices},
            {"refilled_faces", r.refilled_faces}};
}

void tell(const RepairReport& report, const Json& counts, Session& session) {
    if (!session.json)
        for (const auto& [what, count] : counts.items())
            if (count.is_number() && count.get<std::uint64_t>() > 0) {
                std::string words = what;
                std::replace(words.begin(), words.end(), '_', ' ');
                session.say(fmt::format("{:<27} {}", words, count.dump()));
            }
    if (report.intersecting_faces_after.value_or(0) > 0)
        session.warn(fmt::format("{} faces still cut each other", *report.intersecting_faces_after));
    if (report.open_holes > 0) session.warn(fmt::format("{} holes are still open", report.open_holes));
}

void run_repair(const RepairFlags& o, Session& session) {
    RepairReport report;
    run_mesh_command(o.files, "repairing", session, [&](const MeshWork& work) {
        RepairResult result = repair(work.in, o.options, work.progress);
        work.json["repaired"] = report_json(result.report);
        report = result.report;
        return std::move(result.mesh);
    });
    tell(report, report_json(report), session);
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
