// vdbgeo measure: numbers of a mesh.
#include <fmt/format.h>

#include "apps/command.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"

namespace vdbgeo::app {
namespace {

struct MeasureOptions {
    std::string in, histogram;
};

void run_measure(const MeasureOptions& o, Session& session) {
    if (!o.histogram.empty() && !has_ending(o.histogram, ".png"))
        throw UsageError(fmt::format("{}: pictures are PNG files: .png", o.histogram));
    Json seconds;
    Clock clock;
    const TriMesh mesh = read_mesh(o.in, session.stage("reading"));
    seconds["read"] = clock.lap();
    const MeshMeasures measures = measure_mesh(mesh, session.stage("measuring"));
    seconds["compute"] = clock.lap();
    session.end_stage();
    Json j = measures_json(measures);
    j["angle_histogram"] = measures.angle_histogram;
    j["seconds"] = seconds;
    if (!o.histogram.empty()) write_angle_histogram(measures, o.histogram);
    if (!session.json)
        for (const std::string& line : measures_text(measures)) session.say(line);
    session.result(j);
}

}  // namespace

Command measure_command() {
    return {"measure", "Area, volume, components, genus, closedness and angles of a mesh",
            "  vdbgeo measure groel.ply --json", [](CLI::App& app) {
                auto o = std::make_shared<MeasureOptions>();
                app.add_option("mesh", o->in, "Mesh: " + mesh_endings_text())->required();
                app.add_option("--histogram", o->histogram,
                               "Write the histogram of the triangles' angles as a PNG here");
                return [o](Session& session) { run_measure(*o, session); };
            }};
}

}  // namespace vdbgeo::app
