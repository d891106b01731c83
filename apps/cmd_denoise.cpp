// vdbgeo denoise: noise removal by hyperdiffusion, or by the filters that everybody knows.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>

#include "apps/block_filter.h"
#include "apps/command.h"
#include "apps/flow_flags.h"
#include "apps/map_filter.h"
#include "apps/plots.h"
#include "apps/preview.h"
#include "apps/render_slices.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "apps/team_filter.h"
#include "vdbgeo/blocks/blocked_diffusion.h"
#include "vdbgeo/flow/baselines.h"
#include "vdbgeo/flow/noise.h"
#include "vdbgeo/volume/map_statistics.h"

namespace vdbgeo::app {
namespace {

struct DenoiseOptions;
void check_for_team(const DenoiseOptions& o, Session& session);

struct DenoiseOptions {
    MapFilterFlags files;
    DiffusionFlags diffusion;
    CheckpointFlags checkpoints;
    std::string method = "hyperdiffusion", spectra;
    std::string slices;  ///< beginning of the names of bare sections before and after
    PlotFlags plots;
    double blur = BilateralOptions().sigma;
    std::optional<double> range;
    int radius = 1;
    /// Flags that mean something to some methods only.
    std::vector<CLI::Option*> for_diffusion, for_blur, for_range, for_radius;

    bool diffuses() const { return method == "hyperdiffusion" || method == "perona-malik"; }
    void check_flags() const;
    void finish(Session& session);
};

void DenoiseOptions::check_flags() const {
    const bool blurs = method == "gaussian" || method == "bilateral";
    const std::vector<std::pair<const std::vector<CLI::Option*>*, bool>> groups{
        {&for_diffusion, diffuses()},
        {&for_blur, blurs},
        {&for_range, method == "bilateral"},
        {&for_radius, method == "median"}};
    for (const auto& [flags, wanted] : groups)
        for (const CLI::Option* flag : *flags)
            if (flag->count() > 0 && !wanted)
                throw UsageError(fmt::format("{} means nothing to --method {}", flag->get_name(), method));
}

void DenoiseOptions::finish(Session& session) {
    files.finish();
    check_flags();
    if (!session.team) check_map_output(files.out, session);
    check_plot_output(spectra);
    plots.check(!spectra.empty(), "--spectra");
    check_folder_of(slices);
    check_folder_of(spectra);
    if (method == "bilateral") check_usage(BilateralOptions{blur, range.value_or(1)});
    if (method == "perona-malik") {
        if (!diffusion.orders.empty())
            throw UsageError("--method perona-malik is --order 0: give one of them");
        diffusion.orders = "0";
    }
    diffusion.finish();
    if (!diffuses() && !checkpoints.options.folder.empty())
        throw UsageError(fmt::format("--checkpoint means nothing to --method {}", method));
    checkpoints.finish();
    if (session.team) check_for_team(*this, session);
}

/// What was chosen and done, for the result and in words; what is empty or null does not apply.
struct Outcome {
    Json numbers;
    std::vector<std::string> lines;
    std::string history;
    double removed = 0;
    std::uint64_t bytes_sent = 0;  ///< by this member of a team to others
};

std::string noise_text(double noise) { return fmt::format("{:.4g} (estimated standard deviation)", noise); }

Outcome outcome_of(const DenoiseOptions& o, const HyperdiffusionReport& r) {
    const HyperdiffusionOptions& options = o.diffusion.options;
    std::vector<int> orders;
    std::vector<double> diffusivities;
    for (const DiffusionTerm& term : options.terms) {
        orders.push_back(term.order);
        diffusivities.push_back(term.diffusivity);
    }
    Outcome out;
    out.removed = r.removed;
    out.bytes_sent = r.bytes_sent;
    Json& j = out.numbers;
    j["order"] = orders;
    j["diffusivity"] = diffusivities;
    j["sigma"] = options.sigma.text();
    j["stepper"] = name_of(options.stepper);
    j["fidelity"] = options.fidelity;
    j["automatic"] = r.automatic;
    j["noise"] = r.automatic ? Json(r.noise) : Json();
    j.update(report_json(r));
    const std::string settings = fmt::format(
        "order {}, diffusivity {}, sigma {}{}", fmt::join(orders, ","), fmt::join(diffusivities, ","),
        options.sigma.text(), options.fidelity > 0 ? fmt::format(", fidelity {:.6g}", options.fidelity) : "");
    out.lines = {fmt::format("method      {}, {}", o.method, settings)};
    if (r.automatic) out.lines.push_back(fmt::format("noise       {}", noise_text(r.noise)));
    out.lines.push_back(fmt::format("time        {} ({}){}", steps_text(r), name_of(options.stepper),
                                    r.automatic ? ", until the noise is gone" : ""));
    out.history = fmt::format("{}, time {:.9g}{}, {} steps, dt {:.9g}, {}", settings, r.time,
                              r.automatic ? " (auto)" : "", r.steps, r.dt, name_of(options.stepper));
    return out;
}

Outcome diffuse(const DenoiseOptions& o, openvdb::FloatGrid& grid, const stencil::Share* share,
                Session& session) {
    return outcome_of(o, o.checkpoints.run(session, [&] {
        return naming(o.files.in, [&] {
            return hyperdiffuse(grid, o.diffusion.options, session.stage("denoising"), share,
                                o.checkpoints.options);
        });
    }));
}

Outcome filter(const DenoiseOptions& o, openvdb::FloatGrid& grid, const Progress& progress) {
    Outcome out;
    Json& j = out.numbers;
    const openvdb::FloatGrid::Ptr before = grid.deepCopy();
    const Moments moments = active_moments(grid);
    const double noise = estimate_noise(grid);
    j["automatic"] = o.method == "bilateral" && !o.range;
    j["noise"] = noise;
    naming(o.files.in, [&] {
        if (o.method == "gaussian") {
            gaussian_filter(grid, o.blur, progress);
            j["blur"] = o.blur;
            out.history = fmt::format("blur {}", o.blur);
        } else if (o.method == "median") {
            median_filter(grid, o.radius, progress);
            j["radius"] = o.radius;
            out.history = fmt::format("radius {}", o.radius);
        } else {
            const double range = o.range ? *o.range : noise > 0 ? 2.5 * noise : 1;
            bilateral_filter(grid, {o.blur, range}, progress);
            j["blur"] = o.blur;
            j["range"] = range;
            out.history = fmt::format("blur {}, range {:.6g}", o.blur, range);
        }
    });
    j["active_voxels"] = moments.count;
    j["mean_before"] = moments.mean;
    j["mean_after"] = active_moments(grid).mean;
    out.removed = rms_difference(grid, *before);
    out.lines = {fmt::format("method      {}, {}", o.method, out.history),
                 fmt::format("noise       {}", noise_text(noise))};
    return out;
}

void say_outcome(const Outcome& outcome, const Json& j, double rms_before, Session& session) {
    if (session.json || session.quiet) return;
    for (const std::string& line : outcome.lines) session.say(line);
    const double share = rms_before > 0 ? 100 * outcome.removed / rms_before : 0;
    session.say(
        fmt::format("removed     {:.4g} (root mean square), {:.1f} % of the map's deviation of {:.4g}",
                    outcome.removed, share, rms_before));
    session.say(fmt::format("mean        {:.6g}, was {:.6g}", j["mean_after"].get<double>(),
                            j["mean_before"].get<double>()));
    session.say(fmt::format("voxels      {}", j["active_voxels"].get<std::uint64_t>()));
}

void check_for_team(const DenoiseOptions& o, Session& session) {
    check_team_output(o.files, session);
    if (!o.diffuses()) throw UsageError(fmt::format("--method {}: a team runs hyperdiffusion", o.method));
    if (o.diffusion.options.stepper == Stepper::adi)
        throw UsageError(
            "--stepper adi: its lines run through the whole map; a team takes steps (euler, fsi)");
    for (const auto& [flag, value] : {std::pair("--spectra", o.spectra), {"--slices", o.slices}})
        if (!value.empty()) throw UsageError(fmt::format("{}: a team draws no pictures", flag));
}

void warn_unchanged(const DenoiseOptions& o, const Json& j, const Outcome& outcome, Session& session) {
    if (j["automatic"] == true && outcome.removed == 0)
        session.warn(o.files.in +
                     ": no noise was found, and nothing was changed; --time tells how long to diffuse");
}

bool draws(const DenoiseOptions& o) {
    return !o.files.preview.empty() || !o.spectra.empty() || !o.slices.empty();
}

/// A map that does not fit into memory.
void run_denoise_in_blocks(const DenoiseOptions& o, Session& session) {
    BlockedCommand command;
    command.stage = "denoising";
    command.compute = [&](const MapSource& source, const BlockOptions& blocks, HyperdiffusionReport& report,
                          const Progress& progress) {
        return hyperdiffuse_blocks(source, o.diffusion.options, blocks, report, progress);
    };
    command.history = [&](const HyperdiffusionReport& report) {
        return fmt::format("denoised: {}, {}", o.method, outcome_of(o, report).history);
    };
    command.checkpoints = &o.checkpoints;
    BlockedOutcome done = filter_in_blocks(o.files, command, session);
    const Outcome outcome = outcome_of(o, done.report);
    Json& j = done.result;
    j["method"] = o.method;
    j.update(outcome.numbers);
    j["removed"] = outcome.removed;
    j["seconds"] = done.seconds;
    say_outcome(outcome, j, done.deviation, session);
    warn_unchanged(o, j, outcome, session);
    session.result(j);
}

void run_denoise(const DenoiseOptions& o, Session& session) {
    Json seconds;
    Clock clock;
    const double state = o.diffuses() ? 20.2 : 16.4;  // bytes a voxel: grid and fields
    const MemoryNeed need{"denoising", state};
    const bool blocks_will_do =
        o.diffuses() && o.diffusion.options.stepper != Stepper::adi && !draws(o) && !session.team;
    if (blocks_will_do && in_blocks(o.files, need)) return run_denoise_in_blocks(o, session);
    FilterInput input = read_filter_input(o.files, need, hyperdiffusion_halo(o.diffusion.options), session);
    MapFile& in = input.in;
    need_density(o.files.in, in);
    seconds["read"] = clock.lap();
    Preview preview;
    SlicePairs slices;
    const bool shown = !o.files.preview.empty() || !o.spectra.empty();
    if (!o.slices.empty()) slices.take_before(in.map);
    if (shown) preview.add("before", in.map, Preview::Greys::own, session.stage("preview"));
    const double rms_before = active_moments(*in.map.grid, input.counted()).statistics().rms;
    seconds["preview"] = clock.lap();
    openvdb::FloatGrid& grid = *in.map.grid;
    const Outcome outcome =
        o.diffuses() ? diffuse(o, grid, input.share(), session) : filter(o, grid, session.stage("denoising"));
    finish_map(input, fmt::format("denoised: {}, {}", o.method, outcome.history));
    seconds["compute"] = clock.lap();
    Json j = filter_result(o.files, in);
    j["method"] = o.method;
    j.update(outcome.numbers);
    j["removed"] = outcome.removed;
    j.update(statistics_json(in.map.statistics));
    if (shown) preview.add("after", in.map, Preview::Greys::as_first, session.stage("preview"));
    if (!o.slices.empty()) slices.take_after(in.map);
    seconds["preview"] = seconds["preview"].get<double>() + clock.lap();
    write_filtered(o.files, input, outcome.bytes_sent, j, session);
    seconds["write"] = clock.lap();
    o.checkpoints.remove(session);
    if (shown) {
        if (!o.files.preview.empty()) {
            preview.write(o.files.preview);
            j["preview"] = o.files.preview;
        }
        if (!o.spectra.empty()) {
            write_drawing(preview.plot_spectra(o.plots.theme()), o.spectra);
            j["spectra"] = o.spectra;
        }
    } else {
        seconds.erase("preview");
    }
    if (!o.slices.empty()) j["slices"] = slices.write(o.slices);
    j["seconds"] = seconds;
    say_outcome(outcome, j, rms_before, session);
    warn_unchanged(o, j, outcome, session);
    session.result(j);
}

}  // namespace

Command denoise_command() {
    return {
        "denoise",
        "Take the noise out of a map by hyperdiffusion; or by a Gaussian, a median, a bilateral filter",
        "  vdbgeo denoise emd_1080.map smooth.mrc --preview smooth.png --spectra spectra.svg\n"
        "  vdbgeo denoise emd_1080.map smooth.vdb --order 1 --sigma local:3 --time 2\n"
        "  vdbgeo denoise emd_1080.map median.mrc --method median --radius 1",
        [](CLI::App& app) {
            auto o = std::make_shared<DenoiseOptions>();
            app.add_option("--method", o->method,
                           "hyperdiffusion, perona-malik (its order 0), gaussian, median or bilateral")
                ->check(CLI::IsMember({"hyperdiffusion", "perona-malik", "gaussian", "median", "bilateral"})
                            .description(""))
                ->capture_default_str();
            o->for_diffusion = o->diffusion.add(app);
            o->for_blur = {app.add_option("--blur", o->blur,
                                          "Standard deviation of the gaussian and the bilateral filter in "
                                          "voxels, to 10.5")
                               ->check(CLI::Range(0.0, 10.5).description(""))
                               ->capture_default_str()};
            o->for_range = {app.add_option("--range", o->range,
                                           "Difference in density, in the map's units, that the bilateral "
                                           "filter keeps [2.5 times the estimated noise]")};
            o->for_radius = {
                app.add_option("--radius", o->radius, "Radius of the median's window in voxels, to 8")
                    ->check(CLI::Range(0, 8).description(""))
                    ->capture_default_str()};
            o->files.add(app,
                         "Map to write: .mrc .map .ccp4 .rec, .vdb or .nvdb; - is an MRC map for a pipe");
            o->files.add_preview(app, "Picture (PNG) of sections and power spectra before and after");
            o->checkpoints.add(app);
            app.add_option("--spectra", o->spectra,
                           "Plot the radial power spectra before and after here (PNG or SVG)");
            o->plots.add(app);
            app.add_option("--slices", o->slices,
                           "Write the middle sections, bare and in the same greys, before and after: "
                           "SLICES_before_x.png, SLICES_after_x.png, and y, z [none]");
            return [o](Session& session) {
                o->finish(session);
                run_denoise(*o, session);
            };
        }};
}

}  // namespace vdbgeo::app
