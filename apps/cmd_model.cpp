// vdbgeo model: the whole protocol on one map, from file to surface, numbers, tetrahedra, pictures and
// report.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "apps/command.h"
#include "apps/flags.h"
#include "apps/model_options.h"
#include "apps/model_run.h"
#include "apps/model_stages.h"

namespace vdbgeo::app {
namespace {

/// Flags of the command itself that are options of a stage: they are passed on as they are typed.
struct PassedOn {
    std::string stage;
    std::vector<CLI::Option*> options;
};

struct ModelFlags {
    ModelOptions options;
    std::string config;
    bool print_options = false;
    std::vector<std::string> set, skip;
    MapFlags map;
    IsoFlag iso;
    VdbWriteOptions vdb;
    std::string width, view, occlusion;
    std::vector<PassedOn> passed_on;
};

/// Runs `add` and notes which options it added to the app.
void pass_on(CLI::App& app, ModelFlags& flags, const std::string& stage, const std::function<void()>& add) {
    const auto before = app.get_options();
    add();
    PassedOn passed{stage, {}};
    for (CLI::Option* option : app.get_options())
        if (std::find(before.begin(), before.end(), option) == before.end()) passed.options.push_back(option);
    flags.passed_on.push_back(std::move(passed));
}

/// The preset, what the file says over it, and what the command line says over both.
void gather(ModelFlags& flags, const CLI::App& app) {
    ModelOptions& o = flags.options;
    const std::string preset = o.preset;
    if (!flags.config.empty()) read_config(flags.config, o);
    if (app.get_option("--preset")->count() > 0) o.preset = preset;
    for (const PassedOn& passed : flags.passed_on)
        for (const CLI::Option* option : passed.options) {
            if (option->count() == 0) continue;
            const bool flag = option->get_items_expected_max() == 0;
            const std::string key = option->get_name().substr(2);
            merge_sections(o.given,
                           {{passed.stage, {{key, flag ? Json(true) : Json(option->results()[0])}}}});
        }
    for (const std::string& text : flags.set) set_option(text, o.given);
    for (const std::string& stage : flags.skip) {
        if (!find_stage(stage))
            throw UsageError(fmt::format("--skip {}: expected one of {}", stage, stage_names()));
        o.given[stage] = false;
    }
    for (const auto& [flag, stage] : {std::pair("--from", o.from), std::pair("--to", o.to)})
        if (!stage.empty() && !find_stage(stage))
            throw UsageError(fmt::format("{} {}: expected one of {}", flag, stage, stage_names()));
    if (o.in.empty()) throw UsageError("a map is needed, or --config with the summary of an earlier model");
    if (o.folder.empty()) throw UsageError("a folder for the results is needed: -o DIR");
    if (o.in == "-") throw UsageError("-: a model is made of a file, not of a pipe");
    for (const char* stage : {"map", "surface"})
        if (o.sections().value(stage, Json(true)) == Json(false))
            throw UsageError(fmt::format("there is no model without the stage {}", stage));
}

std::string number_text(const Json& result, const char* key, const char* unit) {
    return result.contains(key) && result[key].is_number()
               ? fmt::format("{:.6g}{}", result[key].get<double>(), unit)
               : std::string("–");
}

/// What a reader wants to know first.
void say_summary(const Json& summary, const std::string& folder, Session& session) {
    const auto path = [&](const char* name) { return (std::filesystem::path(folder) / name).string(); };
    for (const Json& entry : summary["stages"]) {
        const std::string name = entry["name"], status = entry["status"];
        if (status == "reused") session.say(fmt::format("{:<11} as it was", name));
        if (!entry.contains("result")) continue;
        const Json& r = entry["result"];
        if (name == "surface") session.say(fmt::format("isovalue    {}", number_text(r, "iso", "")));
        if (name == "measure") {
            const Json& m = r.contains("files") ? r["files"].back() : r;
            session.say(fmt::format("surface     {} faces in {} pieces, area {}, volume {}",
                                    number_text(m, "faces", ""), number_text(m, "components", ""),
                                    number_text(m, "area_A2", " Å²"), number_text(m, "volume_A3", " Å³")));
        }
        if (name == "pockets") session.say(fmt::format("pockets     {}", number_text(r, "pockets", "")));
        if (name == "tets")
            session.say(fmt::format("tetrahedra  {}, dihedral angles {} to {}", number_text(r, "tets", ""),
                                    number_text(r, "min_dihedral_deg", "°"),
                                    number_text(r, "max_dihedral_deg", "°")));
        if (name == "report") session.say(fmt::format("report      {}", path("report.html")));
    }
    session.say(fmt::format("numbers     {}", path("summary.json")));
}

void add_flags(CLI::App& app, ModelFlags& flags) {
    ModelOptions& o = flags.options;
    app.add_option("map", o.in, "Map (MRC, CCP4) or VDB grid; with --config SUMMARY that of the summary");
    app.add_option("-o,--out", o.folder, "Folder for the results; made where it is not there");
    app.add_option("--preset", o.preset,
                   "What the map is: molecule (published, filtered), tomogram (raw, noisy) or label (a "
                   "segmentation)")
        ->check(CLI::IsMember(ModelOptions::presets()).description(""))
        ->capture_default_str();
    app.add_option("--config", flags.config,
                   "JSON file of options, a section a stage, or the summary.json of an earlier model");
    app.add_option(
        "--set", flags.set,
        "STAGE.OPTION=VALUE: an option of a stage's command, such as tets.method=cgal; may be repeated");
    app.add_option("--skip", flags.skip, "Leave this stage out; may be repeated");
    app.add_option("--from", o.from,
                   "Begin with this stage and take what earlier ones left as it is: " + stage_names());
    app.add_option("--to", o.to, "End with this stage [report]");
    app.add_flag("--print-options", flags.print_options,
                 "Print a file for --config with every option, its default and what it does, and end");
    app.add_flag("--fresh", o.fresh, "Run every stage, also where nothing has changed since the last run");
    pass_on(app, flags, "surface", [&] { flags.iso.add(app); });
    pass_on(app, flags, "map", [&] {
        flags.map.add_reading(app);
        flags.map.add_sparsify(app);
        add_vdb_flags(app, flags.vdb);
    });
    pass_on(app, flags, "pictures", [&] {
        app.add_option("--width", flags.width, "Width of the pictures in pixels [1000]");
        app.add_option("--view", flags.view, "Of the pictures: three, front, side, top, iso, or x,y,z");
        app.add_option("--occlusion", flags.occlusion,
                       "Rays of ambient occlusion in the pictures, 0 to 1024");
    });
}

}  // namespace

Command model_command() {
    return {
        "model",
        "The whole protocol on a map: grid, noise, surface, curvature, pockets, tetrahedra, pictures, report",
        "  vdbgeo model emd_1080.map -o groel --iso 0.8\n"
        "  vdbgeo model tomogram.rec -o tomo --preset tomogram --iso 1.5sigma\n"
        "  vdbgeo model emd_1080.map -o groel --iso 0.8 --set remesh.length=3 --set tets.method=cgal\n"
        "  vdbgeo model other.map -o other --config groel/summary.json",
        [](CLI::App& app) {
            auto flags = std::make_shared<ModelFlags>();
            add_flags(app, *flags);
            return [flags, &app](Session& session) {
                if (flags->print_options) return session.say(all_options_text());
                gather(*flags, app);
                lead_or_follow(session, [&](const RunLine& run) {
                    const Json summary = run_model(flags->options, session, run);
                    if (!session.json) say_summary(summary, flags->options.folder, session);
                    session.result(summary);
                });
            };
        }};
}

}  // namespace vdbgeo::app
