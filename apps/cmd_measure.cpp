// vdbgeo measure: numbers of a mesh.
#include <fmt/format.h>

#include <filesystem>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/plots.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/map_options.h"
#include "converters/mesh_file.h"
#include "converters/stored_ply.h"
#include "vdbgeo/measure/surface_distance.h"

namespace vdbgeo::app {
namespace {

struct MeasureOptions {
    std::vector<std::string> in;
    std::string histogram, distance, memory;
    PlotFlags plots;

    std::uint64_t limit() const {
        MapReadOptions options;
        if (!memory.empty()) options.memory = parse_bytes("--memory", memory);
        return options.memory_limit();
    }
};

/// The mesh, to be looked up in its file, where it would not fit into memory; null where it is to be read.
std::unique_ptr<StoredMesh> too_large(const std::string& file, const MeasureOptions& o) {
    constexpr double bytes_a_face = 50, bytes_a_vertex = 40;
    std::error_code error;
    if (!has_ending(file, ".ply") || !o.distance.empty() || !std::filesystem::is_regular_file(file, error))
        return nullptr;
    auto stored = stored_ply(file);
    if (!stored) return nullptr;
    const double all = bytes_a_face * double(stored->faces()) + bytes_a_vertex * double(stored->vertices());
    return all > double(o.limit()) ? std::move(stored) : nullptr;
}

Json measure_one(const std::string& file, const MeasureOptions& o, MeshMeasures& measures, Session& session) {
    Json seconds;
    Clock clock;
    TriMesh mesh;
    if (const auto stored = too_large(file, o)) {
        measures = naming(file, [&] { return measure_mesh(*stored, o.limit(), session.stage("measuring")); });
    } else {
        mesh = read_mesh(file, session.stage("reading"));
        seconds["read"] = clock.lap();
        measures = measure_mesh(mesh, session.stage("measuring"));
    }
    seconds["compute"] = clock.lap();
    session.end_stage();
    Json j{{"file", file}};
    j.update(measures_json(measures));
    j["angle_histogram"] = measures.angle_histogram;
    if (!o.distance.empty()) {
        const TriMesh other = read_mesh(o.distance, session.stage("reading"));
        const SurfaceDistance d =
            naming(file, [&] { return surface_distance(mesh, other, {}, session.stage("distance")); });
        seconds["distance"] = clock.lap();
        session.end_stage();
        j["hausdorff_A"] = d.hausdorff;
        j["distance_forward"] = one_sided_json(d.forward);
        j["distance_backward"] = one_sided_json(d.backward);
    }
    j["seconds"] = seconds;
    return j;
}

void run_measure(const MeasureOptions& o, Session& session) {
    o.limit();
    check_plot_output(o.histogram);
    o.plots.check(!o.histogram.empty(), "--histogram");
    check_folder_of(o.histogram);
    if (!o.distance.empty() && o.in.size() > 1) throw UsageError("--distance is that of one mesh to another");
    Json all = Json::array();
    std::vector<std::pair<std::string, MeshMeasures>> meshes;
    std::vector<std::string> lines;
    for (const std::string& file : o.in) {
        meshes.emplace_back(std::filesystem::path(file).filename().string(), MeshMeasures{});
        all.push_back(measure_one(file, o, meshes.back().second, session));
        if (o.in.size() > 1) lines.push_back(file + ":");
        for (const std::string& line : measures_text(meshes.back().second)) lines.push_back(line);
        if (!o.distance.empty())
            lines.push_back(fmt::format("distance    {:.4g} Å at most (Hausdorff)",
                                        all.back()["hausdorff_A"].get<double>()));
        if (file != o.in.back()) lines.emplace_back();
    }
    if (!o.histogram.empty()) write_angle_histograms(meshes, o.histogram, o.plots.theme());
    if (!session.json)
        for (const std::string& line : lines) session.say(line);
    session.result(all.size() == 1 ? all[0] : Json{{"files", all}});
}

}  // namespace

Command measure_command() {
    return {"measure", "Area, volume, components, genus, closedness and angles of a mesh",
            "  vdbgeo measure groel.ply --json", [](CLI::App& app) {
                auto o = std::make_shared<MeasureOptions>();
                app.add_option("meshes", o->in, "Meshes: " + mesh_endings_text())->required();
                app.add_option(
                    "--histogram", o->histogram,
                    "Plot the histogram of the triangles' angles here (PNG or SVG), of several meshes as "
                    "curves");
                o->plots.add(app);
                app.add_option("--distance", o->distance,
                               "Measure how far the mesh is from this one, both ways, in Å");
                app.add_option(
                    "--memory", o->memory,
                    "Memory that may be taken, such as 2G or 512M: a .ply file that does not fit is "
                    "measured part by part [half of the machine's]");
                return [o](Session& session) { run_measure(*o, session); };
            }};
}

}  // namespace vdbgeo::app
