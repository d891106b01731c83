// vdbgeo flow: geometric flows of a density, and of a surface as a level set.
#include <fmt/format.h>

#include <cmath>

#include "apps/block_filter.h"
#include "apps/command.h"
#include "apps/flow_flags.h"
#include "apps/map_filter.h"
#include "apps/preview.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "apps/team_filter.h"
#include "vdbgeo/blocks/blocked_flow.h"
#include "vdbgeo/surface/level_set.h"

namespace vdbgeo::app {
namespace {

struct FlowOptions {
    MapFilterFlags files;
    FlowFlags flow;
    IsoFlag iso;
    const CLI::Option* iso_flag = nullptr;

    bool moves_surface() const { return !flow.surface_kind.empty(); }
};

/// What the two kinds of flow do alike once the map has moved.
struct Run {
    Json result, seconds;
    Preview preview;
    Clock clock;
};

void write_moved(const FlowOptions& o, FilterInput& input, const DensityMap& map, std::uint64_t bytes_sent,
                 Run& run, Session& session) {
    run.seconds["compute"] = run.clock.lap();
    run.result.update(statistics_json(map.statistics));
    const bool shown = !o.files.preview.empty();
    if (shown) run.preview.add("after", map, Preview::Greys::as_first, session.stage("preview"));
    run.clock.lap();
    if (input.part)
        write_filtered(o.files, input, bytes_sent, run.result, session);
    else
        write_filtered(o.files, map, run.result, session);
    run.seconds["write"] = run.clock.lap();
    if (shown) {
        run.preview.write(o.files.preview);
        run.result["preview"] = o.files.preview;
    }
    run.result["seconds"] = run.seconds;
}

void start_preview(const FlowOptions& o, const DensityMap& map, Run& run, Session& session) {
    if (!o.files.preview.empty())
        run.preview.add("before", map, Preview::Greys::own, session.stage("preview"));
    run.clock.lap();
}

std::string settings_of(const GeometricFlowOptions& options) {
    return fmt::format("order {}, fidelity {}, pressure {}, density scale {}", options.order,
                       options.fidelity, options.pressure, options.scale);
}

std::string history_of(const GeometricFlowOptions& options, const HyperdiffusionReport& r) {
    return fmt::format("flow of the density: {}, time {:.9g}, {} steps", settings_of(options), r.time,
                       r.steps);
}

/// What was chosen and done.
void add_flow(const GeometricFlowOptions& options, const HyperdiffusionReport& r, Json& result) {
    result["flow"] = "density";
    result.update({{"order", options.order},
                   {"fidelity", options.fidelity},
                   {"pressure", options.pressure},
                   {"density_scale", options.scale}});
    result.update(report_json(r));
    result["removed"] = r.removed;
}

void say_flow(const GeometricFlowOptions& options, const HyperdiffusionReport& r, Session& session) {
    if (session.json || session.quiet) return;
    session.say(fmt::format("flow        of the density, {}", settings_of(options)));
    session.say(fmt::format("time        {}", steps_text(r)));
    session.say(fmt::format("removed     {:.4g} (root mean square)", r.removed));
    session.say(fmt::format("voxels      {}", r.active_voxels));
}

void move_density(const FlowOptions& o, FilterInput& input, Run& run, Session& session) {
    MapFile& in = input.in;
    need_density(o.files.in, in);
    start_preview(o, in.map, run, session);
    const GeometricFlowOptions& options = o.flow.density;
    const Progress progress = session.stage("flow");
    const HyperdiffusionReport r =
        naming(o.files.in, [&] { return geometric_flow(*in.map.grid, options, progress, input.share()); });
    finish_map(input, history_of(options, r));
    add_flow(options, r, run.result);
    write_moved(o, input, in.map, r.bytes_sent, run, session);
    say_flow(options, r, session);
}

/// A map that does not fit into memory.
void move_density_in_blocks(const FlowOptions& o, Session& session) {
    const GeometricFlowOptions& options = o.flow.density;
    BlockedCommand command;
    command.stage = "flow";
    command.compute = [&](const MapSource& source, const BlockOptions& blocks, HyperdiffusionReport& report,
                          const Progress& progress) {
        return geometric_flow_blocks(source, options, blocks, report, progress);
    };
    command.history = [&](const HyperdiffusionReport& report) { return history_of(options, report); };
    BlockedOutcome done = filter_in_blocks(o.files, command, session);
    add_flow(options, done.report, done.result);
    done.result["seconds"] = done.seconds;
    say_flow(options, done.report, session);
    session.result(done.result);
}

/// The level set that is to move: the grid itself, or the one of an isosurface.
DensityMap surface_of(const FlowOptions& o, const MapFile& in, Json& result, Session& session) {
    if (in.level_set && o.iso_flag->count() == 0) return in.map;
    const Isovalue rule = o.iso.parse();
    const Progress progress = session.stage("surface");
    return naming(o.files.in, [&] {
        const double isovalue = rule.resolve(in.map);
        result["iso"] = isovalue;
        LevelSetOptions options;
        options.half_width = std::max<double>(options.half_width, o.flow.surface.half_width);
        return map_from_grid(level_set(in.map, isovalue, options, progress));
    });
}

void move_surface(const FlowOptions& o, FilterInput& input, Run& run, Session& session) {
    MapFile& in = input.in;
    Json& j = run.result;
    j["flow"] = o.flow.surface_kind;
    DensityMap map = surface_of(o, in, j, session);
    in.map.grid.reset();
    start_preview(o, map, run, session);
    const Progress progress = session.stage("flow");
    const LevelSetFlowReport r =
        naming(o.files.in, [&] { return level_set_flow(*map.grid, o.flow.surface, progress); });
    if (r.vanished)
        throw NumericalError(
            fmt::format("{}: nothing is left of the surface after a time of {}; try a shorter --time",
                        o.files.in, o.flow.surface.time));
    finish_map(map, fmt::format("flow of the surface: {}, time {:.9g}, {} steps", o.flow.surface_kind, r.time,
                                r.steps));
    const double voxel = map.frame.voxel_volume();
    j.update({{"dt", r.dt},
              {"steps", r.steps},
              {"time", r.time},
              {"active_voxels", r.active_voxels},
              {"volume_before_A3", voxel * r.volume_before},
              {"volume_after_A3", voxel * r.volume_after}});
    write_moved(o, input, map, 0, run, session);
    if (session.json || session.quiet) return;
    session.say(fmt::format("flow        {} of the surface{}", o.flow.surface_kind,
                            j.contains("iso") ? fmt::format(" at {:.6g}", j["iso"].get<double>()) : ""));
    session.say(fmt::format("time        {:.4g} in {} steps, dt {:.4g}", r.time, r.steps, r.dt));
    session.say(
        fmt::format("volume      {:.6g} Å³, was {:.6g} Å³", voxel * r.volume_after, voxel * r.volume_before));
    session.say(fmt::format("voxels      {}", r.active_voxels));
}

void run_flow(const FlowOptions& o, Session& session) {
    const MemoryNeed need{"the flow", o.moves_surface() ? 4.2 : 20.4};
    if (!o.moves_surface() && !session.team && o.files.preview.empty() && in_blocks(o.files, need))
        return move_density_in_blocks(o, session);
    Run run;
    FilterInput input = read_filter_input(o.files, need, geometric_flow_halo(o.flow.density), session);
    run.seconds["read"] = run.clock.lap();
    run.result = filter_result(o.files, input.in);
    if (o.moves_surface())
        move_surface(o, input, run, session);
    else
        move_density(o, input, run, session);
    session.result(run.result);
}

}  // namespace

Command flow_command() {
    return {"flow", "Move a density, or with --surface its isosurface, by its own curvature",
            "  vdbgeo flow emd_1080.map flowed.mrc --time 1\n"
            "  vdbgeo flow emd_1080.map smooth.vdb --surface mean-curvature --iso 0.8 --time 2",
            [](CLI::App& app) {
                auto o = std::make_shared<FlowOptions>();
                o->flow.add(app);
                o->iso.add(app);
                o->iso_flag = app.get_option("--iso");
                o->files.add(
                    app,
                    "Map to write: .mrc .map .ccp4 .rec, .vdb or .nvdb; - is an MRC map for a pipe; of a "
                    "surface, its signed distances in Å");
                o->files.add_preview(app, "Picture (PNG) of sections and power spectra before and after");
                return [o](Session& session) {
                    o->files.finish();
                    o->flow.finish();
                    o->iso.parse();
                    if (!o->moves_surface() && o->iso_flag->count() > 0)
                        throw UsageError("--iso is for the flow of a surface: it goes with --surface");
                    if (session.team && o->moves_surface())
                        throw UsageError("--surface: a team moves densities; vdbgeo flow moves surfaces");
                    if (session.team)
                        check_team_output(o->files, session);
                    else
                        check_map_output(o->files.out, session);
                    run_flow(*o, session);
                };
            }};
}

}  // namespace vdbgeo::app
