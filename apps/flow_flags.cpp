#include "apps/flow_flags.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <cmath>

#include "apps/flags.h"
#include "vdbgeo/flow/checkpoint.h"

namespace vdbgeo::app {
namespace {

const std::map<std::string, Stepper> steppers{
    {"fsi", Stepper::fsi}, {"euler", Stepper::euler}, {"adi", Stepper::adi}};

const std::map<std::string, SurfaceFlow> surface_flows{{"mean-curvature", SurfaceFlow::mean_curvature},
                                                       {"surface-diffusion", SurfaceFlow::surface_diffusion},
                                                       {"willmore", SurfaceFlow::willmore}};

template <class T>
std::vector<T> parse_list(const std::string& flag, const std::string& text, const char* what) {
    std::vector<T> numbers;
    const char *at = text.data(), *end = text.data() + text.size();
    for (bool more = true; more;) {
        T number{};
        const auto [rest, error] = std::from_chars(at, end, number);
        more = rest != end && *rest == ',';
        if (error != std::errc() || (rest != end && !more) || !std::isfinite(static_cast<double>(number)))
            throw UsageError(fmt::format("{}: '{}' is not {}", flag, text, what));
        numbers.push_back(number);
        at = rest + 1;
    }
    return numbers;
}

double parse_number(const std::string& flag, const std::string& text, const char* what) {
    const auto numbers = parse_list<double>(flag, text, what);
    if (numbers.size() != 1) throw UsageError(fmt::format("{}: '{}' is not {}", flag, text, what));
    return numbers[0];
}

/// One number for all, or one for each.
template <class T>
std::vector<T> spread(const std::string& flag, std::vector<T> numbers, const std::string& other,
                      std::size_t count) {
    if (numbers.size() == 1) numbers.resize(count, numbers[0]);
    if (numbers.size() != count)
        throw UsageError(
            fmt::format("{} has {} numbers where {} has {}", flag, numbers.size(), other, count));
    return numbers;
}

void add_stepper(CLI::App& app, Stepper& stepper) {
    app.add_option("--stepper", stepper,
                   fmt::format("fsi (cycles of growing steps), euler (explicit) or adi (semi-implicit) [{}]",
                               name_of(stepper)))
        ->transform(CLI::CheckedTransformer(steppers).description(""));
}

std::string fallback(const std::vector<std::string>& numbers) {
    return fmt::format(" [{}]", fmt::join(numbers, ","));
}

std::vector<TransformOptions::Pass> make_passes(const std::vector<int>& orders,
                                                const std::vector<double>& times) {
    const auto q = spread("--orders", orders, "--times", times.size());
    std::vector<TransformOptions::Pass> passes;
    for (std::size_t i = 0; i < times.size(); ++i) passes.push_back({q[i], times[i]});
    return passes;
}

/// Two low-passes, between which the band lies: times of passes behind each other add up.
std::vector<TransformOptions::Pass> parse_band(const std::string& text, int order) {
    const char* what = "LOW:HIGH, two times with 0 <= LOW < HIGH";
    const auto fail = [&] { return UsageError(fmt::format("--band-pass: '{}' is not {}", text, what)); };
    const std::size_t colon = text.find(':');
    if (colon == std::string::npos) throw fail();
    const double low = parse_number("--band-pass", text.substr(0, colon), what),
                 high = parse_number("--band-pass", text.substr(colon + 1), what);
    if (!(low >= 0 && low < high)) throw fail();
    return make_passes({order}, {low, high - low});
}

/// "1,3" or "2,residue" of `modes` modes, behind which the residue comes.
std::vector<bool> parse_kept(const std::string& text, std::size_t modes) {
    std::vector<bool> kept(modes + 1);
    for (std::size_t at = 0; at <= text.size();) {
        const std::size_t comma = std::min(text.find(',', at), text.size());
        const std::string word = text.substr(at, comma - at);
        at = comma + 1;
        int mode = static_cast<int>(modes) + 1;
        if (word != "residue") {
            mode = parse_list<int>("--keep", word, "the number of a mode, nor residue")[0];
            if (mode < 1 || mode > static_cast<int>(modes))
                throw UsageError(
                    fmt::format("--keep: there is no mode {}: there are 1 to {}, and residue", word, modes));
        }
        kept[static_cast<std::size_t>(mode - 1)] = true;
    }
    return kept;
}

}  // namespace

std::vector<double> parse_numbers(const std::string& flag, const std::string& text) {
    return parse_list<double>(flag, text, "a number, nor several with commas between them");
}

std::vector<int> parse_integers(const std::string& flag, const std::string& text) {
    return parse_list<int>(flag, text, "a whole number, nor several with commas between them");
}

const char* name_of(Stepper stepper) {
    for (const auto& [name, value] : steppers)
        if (value == stepper) return name.c_str();
    return "";
}

void SigmaFlag::add(CLI::App& app, const EdgeScale& fallback) {
    app.add_option(
        "--sigma", text,
        fmt::format("Gradient above which an edge is kept: local, local:R (from the variance within R "
                    "voxels), global, inf (no edges), or a number in the map's units a voxel [{}]",
                    fallback.text()));
}

void SigmaFlag::finish(EdgeScale& sigma) const {
    if (text.empty()) return;
    try {
        sigma = EdgeScale::parse(text);
    } catch (const InvalidInput& e) {
        throw UsageError(fmt::format("--sigma: {}", e.what()));
    }
}

std::vector<CLI::Option*> DiffusionFlags::add(CLI::App& app) {
    std::vector<std::string> q, d;
    for (const DiffusionTerm& term : options.terms) {
        q.push_back(std::to_string(term.order));
        d.push_back(fmt::format("{}", term.diffusivity));
    }
    std::vector<CLI::Option*> flags;
    const auto add = [&](CLI::Option* flag) { flags.push_back(flag); };
    add(app.add_option("--order", orders,
                       "Order q of the diffusion, 0 to 15; several (0,1) are added up" + fallback(q)));
    add(app.add_option(
        "--diffusivity", diffusivities,
        "Diffusivity in voxels^(2q+2) a unit of time; one, or one for each order" + fallback(d)));
    sigma.add(app, options.sigma);
    add(app.get_option("--sigma"));
    add(app.add_option("--time", time,
                       "How long to diffuse: a number, or auto: until the noise is gone [auto]"));
    add(app.add_option("--steps", options.steps, "Number of steps, instead of --time"));
    add(app.add_option("--dt", options.dt, "Step in time; at most the bound for stability [0.9 of it]"));
    add_stepper(app, options.stepper);
    add(app.get_option("--stepper"));
    add(app.add_option("--cycle", options.cycle,
                       "Steps with the same coefficients, at most, 1 to 300; unset: they grow")
            ->capture_default_str());
    add(app.add_option("--min-cycles", options.min_cycles, "Times that the coefficients are found, at least")
            ->capture_default_str());
    add(app.add_option("--fidelity", options.fidelity, "Pull back towards the input, per unit of time")
            ->capture_default_str());
    return flags;
}

void DiffusionFlags::finish() {
    if (!orders.empty()) {
        options.terms.clear();
        for (const int q : parse_integers("--order", orders)) options.terms.push_back({q, 1.0});
    }
    if (!diffusivities.empty()) {
        const auto d = spread("--diffusivity", parse_numbers("--diffusivity", diffusivities), "--order",
                              options.terms.size());
        for (std::size_t i = 0; i < d.size(); ++i) options.terms[i].diffusivity = d[i];
    }
    if (!time.empty() && time != "auto") options.time = parse_number("--time", time, "a number, nor auto");
    sigma.finish(options.sigma);
    check_usage(options);
}

void HighPassFlags::add(CLI::App& app) {
    app.add_option("--order", options.order, "Order q of both diffusions, 0 to 15")->capture_default_str();
    app.add_option("--slow", options.slow, "Diffusivity of the slow one, voxels^(2q+2) a unit of time")
        ->capture_default_str();
    app.add_option("--fast", options.fast, "Diffusivity of the fast one, voxels^(2q+2) a unit of time")
        ->capture_default_str();
    app.add_option("--coupling", coupling,
                   fmt::format("Pull of each towards the other, per unit of time; one number, or two [{},{}]",
                               options.coupling_u, options.coupling_v));
    sigma.add(app, options.sigma);
    app.add_option("--time", options.time, "How long to diffuse")->capture_default_str();
    app.add_option("--dt", options.dt, "Step in time; at most the bound for stability [0.9 of it]");
    add_stepper(app, options.stepper);
    app.add_option("--cycle", options.cycle,
                   "Steps with the same coefficients, at most, 1 to 300; unset: they grow")
        ->capture_default_str();
}

void HighPassFlags::finish() {
    if (!coupling.empty()) {
        const auto e = spread("--coupling", parse_numbers("--coupling", coupling), "the pair", 2);
        options.coupling_u = e[0];
        options.coupling_v = e[1];
    }
    sigma.finish(options.sigma);
    check_usage(options);
}

void TransformFlags::add(CLI::App& app) {
    std::vector<std::string> q, t;
    for (const TransformOptions::Pass& pass : options.passes) {
        q.push_back(std::to_string(pass.order));
        t.push_back(fmt::format("{}", pass.time));
    }
    app.add_option("--orders", orders,
                   "Order of the low-pass of each mode, 0 to 15; one, or one for each time" + fallback(q));
    app.add_option("--times", times,
                   "Time of the low-pass of each mode, in voxels^(2q+2), from fine to coarse" + fallback(t));
    sigma.add(app, options.sigma);
    add_stepper(app, options.stepper);
    app.add_option("--keep", keep,
                   "Write one file: the sum of these modes, such as 1,3 or 2,residue [all, one file each]");
    app.add_option(
        "--band-pass", band_pass,
        "Write one file: what lies between the low-passes of two times, LOW:HIGH, both of the first "
        "of --orders");
}

void TransformFlags::finish() {
    std::vector<int> q{options.passes[0].order};
    std::vector<double> t;
    for (const TransformOptions::Pass& pass : options.passes) t.push_back(pass.time);
    if (!orders.empty()) q = parse_integers("--orders", orders);
    if (!times.empty()) t = parse_numbers("--times", times);
    if (!band_pass.empty()) {
        if (!times.empty() || !keep.empty() || q.size() > 1)
            throw UsageError("--band-pass takes the place of --times and --keep, and one of --orders");
        options.passes = parse_band(band_pass, q[0]);
        kept = {false, true, false};
    } else if (!orders.empty() || !times.empty()) {
        options.passes = make_passes(q, t);
    }
    if (!keep.empty()) kept = parse_kept(keep, options.passes.size());
    sigma.finish(options.sigma);
    check_usage(options);
}

void FlowFlags::add(CLI::App& app) {
    app.add_option(
           "--surface", surface_kind,
           "Move a surface instead of a density: mean-curvature (smooths, shrinks), surface-diffusion "
           "(keeps the volume) or willmore (keeps spheres)")
        ->check(CLI::IsMember({"mean-curvature", "surface-diffusion", "willmore"}));
    app.add_option("--time", time,
                   fmt::format("How long: voxels^(2q+2) of a density [{}]; of a surface voxels^2 under mean "
                               "curvature, else voxels^4 [{}]",
                               density.time, surface.time));
    app.add_option("--dt", dt, "Longest step in time; at most the bound for stability [chosen by the flow]");
    of_density_ = {
        app.add_option("--order", density.order,
                       "Order q of the flow of a density: 0 mean curvature, 1 surface diffusion, to 7")
            ->capture_default_str(),
        app.add_option("--fidelity", density.fidelity, "Pull back towards the input, per unit of time")
            ->capture_default_str(),
        app.add_option("--pressure", density.pressure, "Speed outward, in voxels a unit of time")
            ->capture_default_str(),
        app.add_option("--density-scale", density.scale,
                       "Density, in the map's units, that counts as one voxel of height")
            ->capture_default_str()};
    of_surface_ = {
        app.add_option("--half-width", surface.half_width,
                       "Half the width of the band that is written, in voxels, 2 to 20 [the input's, or 3]")};
}

void FlowFlags::finish() {
    const bool moves_surface = !surface_kind.empty();
    for (const CLI::Option* flag : moves_surface ? of_density_ : of_surface_)
        if (flag->count() > 0)
            throw UsageError(fmt::format(
                "{} is for the flow of a {}", flag->get_name(),
                moves_surface ? "density: it goes without --surface" : "surface: it goes with --surface"));
    if (moves_surface) {
        surface.flow = surface_flows.at(surface_kind);
        if (time) surface.time = *time;
        surface.dt = dt;
        check_usage(surface);
    } else {
        if (time) density.time = *time;
        density.dt = dt;
        check_usage(density);
    }
}

void CheckpointFlags::add(CLI::App& app) {
    app.add_option_function<std::string>(
        "--checkpoint", [this](const std::string& text) { options.folder = text; },
        "Folder for checkpoints, which a later run can go on from; SIGTERM and SIGUSR1 have one written, and "
        "end the run");
    app.add_option("--checkpoint-every", options.every, "Cycles between two checkpoints")
        ->check(CLI::Range(1, 1000000).description(""))
        ->capture_default_str();
    app.add_flag("--resume", options.resume,
                 "Go on from the newest checkpoint that is whole; from the beginning where there is none");
}

void CheckpointFlags::finish() {
    if (options.folder.empty()) {
        if (options.resume) throw UsageError("--resume needs --checkpoint DIR");
        return;
    }
    options.stop = stop_handler();
}

void CheckpointFlags::remove(const Session& session) const {
    if (options.folder.empty() || (session.team && session.team->rank() != 0)) return;
    remove_checkpoints(options.folder);
}

void CheckpointFlags::say_stopped(Session& session) const {
    if (options.stop && options.stop())
        session.warn(options.folder.string() + ": a checkpoint is written; --resume goes on from it");
}

Json report_json(const HyperdiffusionReport& r) {
    return {{"dt", r.dt},
            {"steps", r.steps},
            {"cycles", r.cycles},
            {"time", r.time},
            {"active_voxels", r.active_voxels},
            {"mean_before", r.mean_before},
            {"mean_after", r.mean_after},
            {"state_bytes", r.state_bytes},
            {"blocks", r.blocks},
            {"resumed_cycles", r.resumed_cycles}};
}

std::string steps_text(const HyperdiffusionReport& r) {
    return fmt::format("{:.4g} in {} step{}, dt {:.4g}", r.time, r.steps, r.steps == 1 ? "" : "s", r.dt);
}

}  // namespace vdbgeo::app
