#include "apps/mesh_command.h"

#include <fmt/format.h>

#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "vdbgeo/measure/surface_distance.h"

namespace vdbgeo::app {
void MeshCommandFlags::add(CLI::App& app, bool distance) {
    app.add_option("in", in, "Mesh: " + mesh_endings_text())->required();
    app.add_option("out", out, "Mesh to write: " + mesh_endings_text())->required();
    if (distance)
        app.add_flag("--no-distance", no_distance, "Do not measure how far the result is from the input");
    else
        no_distance = true;
}

void run_mesh_command(const MeshCommandFlags& flags, const std::string& stage, Session& session,
                      const std::function<TriMesh(const MeshWork&)>& work) {
    check_mesh_output(flags.out);
    Json seconds, more = Json::object();
    Clock clock;
    const TriMesh in = read_mesh(flags.in, session.stage("reading"));
    seconds["read"] = clock.lap();
    const MeshMeasures before = measure_mesh(in, session.stage("measuring"));
    seconds["measure"] = clock.lap();
    const TriMesh out = naming(flags.in, [&] { return work({in, before, session.stage(stage), more}); });
    seconds["compute"] = clock.lap();
    const MeshMeasures after = measure_mesh(out, session.stage("measuring"));
    Json j = measures_json(after);
    j["vertices_before"] = before.vertices;
    j["faces_before"] = before.faces;
    j.update(more);
    std::string distance;
    if (!flags.no_distance && !in.empty() && !out.empty()) {
        try {
            const SurfaceDistance d = surface_distance(in, out, {}, session.stage("distance"));
            j["hausdorff_A"] = d.hausdorff;
            j["distance_to_result"] = one_sided_json(d.forward);
            j["distance_to_input"] = one_sided_json(d.backward);
            distance = fmt::format("distance    {:.4g} Å at most (Hausdorff), {:.4g} Å rms", d.hausdorff,
                                   std::max(d.forward.rms, d.backward.rms));
        } catch (const InvalidInput& e) {  // no reason to lose the result
            session.end_stage();
            session.warn(
                fmt::format("{}: the distance to the result is not measured: {}", flags.in, e.what()));
        }
    }
    seconds["measure"] = seconds["measure"].get<double>() + clock.lap();
    write_mesh(out, flags.out, {}, session.stage("writing"));
    seconds["write"] = clock.lap();
    session.end_stage();
    j["seconds"] = seconds;
    if (!session.json) {
        session.say(fmt::format("before      {} vertices, {} faces, angles {:.3g}° to {:.4g}°",
                                before.vertices, before.faces, before.min_angle_deg, before.max_angle_deg));
        for (const std::string& line : measures_text(after)) session.say(line);
        if (!distance.empty()) session.say(distance);
    }
    session.result(j);
}

}  // namespace vdbgeo::app
