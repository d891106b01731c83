// vdbgeo model: the whole protocol on one map, from file to surface, numbers and picture.
#include <fmt/format.h>

#include <filesystem>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/mesh_file.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/png.h"

namespace vdbgeo::app {
namespace {

namespace fs = std::filesystem;

struct ModelOptions {
    std::string in, folder;
    MapFlags map;
    IsoFlag iso;
    VdbWriteOptions vdb;
    RenderOptions render;
};

/// What the stages hand on to each other.
struct Model {
    const ModelOptions& options;
    MapFile map;
    Surface surface;
    MeshMeasures measures;

    fs::path out(const std::string& name) const { return fs::path(options.folder) / name; }
};

/// A stage works on the model and tells its options, numbers and files.
struct Stage {
    std::string name;
    std::function<Json(Model&, const Progress&)> run;
};

Json read_stage(Model& m, const Progress& progress) {
    m.map = read_map(m.options.in, m.options.map.options, progress);
    Json j = grid_json(m.map.map);
    j["warnings"] = m.map.warnings;
    return j;
}

Json grid_stage(Model& m, const Progress& progress) {
    write_vdb({m.map.map.grid}, m.out("density.vdb"), m.options.vdb, progress);
    return {{"files", {"density.vdb"}}, {"bytes", fs::file_size(m.out("density.vdb"))}};
}

Json surface_stage(Model& m, const Progress& progress) {
    const Isovalue rule = m.options.iso.parse();
    m.surface = extract_surface(m.options.in, m.map, rule, progress.part(0, 0.7));
    write_mesh(m.surface.mesh, m.out("surface.ply"), {}, progress.part(0.7, 1));
    return {{"files", {"surface.ply"}},
            {"method", "marching-cubes"},
            {"iso", m.surface.isovalue},
            {"iso_rule", rule.text()}};
}

Json measure_stage(Model& m, const Progress& progress) {
    m.measures = measure_mesh(m.surface.mesh, progress);
    write_angle_histogram(m.measures, m.out("angles.png"));
    Json j = measures_json(m.measures);
    j["files"] = {"angles.png"};
    j["open_at_map_border"] = m.measures.boundary_edges > 0;
    return j;
}

Json picture_stage(Model& m, const Progress& progress) {
    RenderOptions options = m.options.render;
    if (options.title.empty())
        options.title = fmt::format("{}, isovalue {:.4g}", fs::path(m.options.in).filename().string(),
                                    m.surface.isovalue);
    const Image image = naming(m.options.in, [&] { return render(m.surface.mesh, options, progress); });
    write_png(image, m.out("surface.png"));
    return {{"files", {"surface.png"}}};
}

/// The pipeline. A stage that comes later in the protocol is one more line here.
const std::vector<Stage>& pipeline() {
    static const std::vector<Stage> stages{{"map", read_stage},
                                           {"grid", grid_stage},
                                           {"surface", surface_stage},
                                           {"measure", measure_stage},
                                           {"picture", picture_stage}};
    return stages;
}

void make_folder(const std::string& folder) {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) throw IoError(fmt::format("{}: cannot be made: {}", folder, error.message()));
}

void run_model(const ModelOptions& o, Session& session) {
    o.iso.parse();
    if (!can_render()) session.warn("this build has no ray caster (embree): there will be no picture");
    Model model{o, {}, {}, {}};
    // The map is looked at before the folder is made: a bad file leaves nothing behind.
    Json stages = Json::array();
    Clock all;
    for (const Stage& stage : pipeline()) {
        if (stage.name == "picture" && !can_render()) continue;
        if (stage.name == "grid") make_folder(o.folder);
        Clock clock;
        Json numbers = stage.run(model, session.stage(stage.name));
        session.end_stage();
        Json entry{{"name", stage.name}, {"seconds", clock.seconds()}};
        entry.update(numbers);
        stages.push_back(entry);
        if (stage.name == "map")
            for (const std::string& w : model.map.warnings) session.warn(o.in + ": " + w);
    }
    Json summary{{"input", o.in},
                 {"options",
                  {{"iso", o.iso.text},
                   {"threshold", o.map.threshold},
                   {"origin", o.map.origin},
                   {"voxel_size", o.map.voxel_size},
                   {"mode0", o.map.mode0},
                   {"invert", o.map.options.invert}}},
                 {"versions", versions_json()},
                 {"seconds", all.seconds()},
                 {"stages", stages}};
    write_file(model.out("summary.json"), json_text(summary, 2) + "\n");
    if (!session.json) {
        session.say(fmt::format("isovalue    {:.6g} ({})", model.surface.isovalue, o.iso.text));
        for (const std::string& line : measures_text(model.measures)) session.say(line);
        if (can_render()) session.say(fmt::format("picture     {}", model.out("surface.png").string()));
        session.say(fmt::format("numbers     {}", model.out("summary.json").string()));
    }
    say_where_open(model.measures, session);
    session.result(summary);
}

}  // namespace

Command model_command() {
    return {"model", "The whole protocol on a map: sparse grid, surface, numbers, picture",
            "  vdbgeo model emd_1080.map -o groel --iso 0.8", [](CLI::App& app) {
                auto o = std::make_shared<ModelOptions>();
                app.add_option("map", o->in, "Map (MRC, CCP4) or VDB grid")->required();
                app.add_option("-o,--out", o->folder, "Folder for the results; made where it is not there")
                    ->required();
                o->iso.add(app);
                o->map.add_reading(app);
                o->map.add_sparsify(app);
                add_vdb_flags(app, o->vdb);
                add_render_flags(app, o->render);
                return [o](Session& session) {
                    o->map.finish();
                    check_usage(o->render);
                    run_model(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
