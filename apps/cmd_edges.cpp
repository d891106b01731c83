// vdbgeo edges: edges of a map as the difference of two coupled diffusions.
#include <fmt/format.h>

#include "apps/block_filter.h"
#include "apps/command.h"
#include "apps/flow_flags.h"
#include "apps/map_filter.h"
#include "apps/preview.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "apps/team_filter.h"
#include "vdbgeo/blocks/blocked_diffusion.h"

namespace vdbgeo::app {
namespace {

struct EdgesOptions {
    MapFilterFlags files;
    HighPassFlags high_pass;
    CheckpointFlags checkpoints;
};

std::string history_of(const HighPassOptions& options, const HyperdiffusionReport& r) {
    return fmt::format(
        "edges: order {}, diffusivities {} and {}, coupling {} and {}, sigma {}, time "
        "{:.9g}, {} steps, dt {:.9g}, {}",
        options.order, options.slow, options.fast, options.coupling_u, options.coupling_v,
        options.sigma.text(), r.time, r.steps, r.dt, name_of(options.stepper));
}

/// What was chosen and done.
void add_result(const HighPassOptions& options, const HyperdiffusionReport& r, Json& j) {
    j.update({{"order", options.order},
              {"slow", options.slow},
              {"fast", options.fast},
              {"coupling_u", options.coupling_u},
              {"coupling_v", options.coupling_v},
              {"sigma", options.sigma.text()},
              {"stepper", name_of(options.stepper)}});
    j.update(report_json(r));
}

void say_result(const HighPassOptions& options, const HyperdiffusionReport& r, const Statistics& statistics,
                Session& session) {
    if (session.json || session.quiet) return;
    session.say(fmt::format("diffusion   order {}, diffusivities {} and {}, sigma {}", options.order,
                            options.slow, options.fast, options.sigma.text()));
    session.say(fmt::format("coupling    {} and {}", options.coupling_u, options.coupling_v));
    session.say(fmt::format("time        {} ({})", steps_text(r), name_of(options.stepper)));
    session.say(fmt::format("edges       {:.4g} to {:.4g}, rms {:.4g}", statistics.min, statistics.max,
                            statistics.rms));
    session.say(fmt::format("voxels      {}", r.active_voxels));
}

/// A map that does not fit into memory.
void run_edges_in_blocks(const EdgesOptions& o, Session& session) {
    const HighPassOptions& options = o.high_pass.options;
    BlockedCommand command;
    command.stage = "edges";
    command.compute = [&](const MapSource& source, const BlockOptions& blocks, HyperdiffusionReport& report,
                          const Progress& progress) {
        return coupled_high_pass_blocks(source, options, blocks, report, progress);
    };
    command.history = [&](const HyperdiffusionReport& report) { return history_of(options, report); };
    command.checkpoints = &o.checkpoints;
    command.cleared = true;
    BlockedOutcome done = filter_in_blocks(o.files, command, session);
    add_result(options, done.report, done.result);
    done.result["seconds"] = done.seconds;
    say_result(options, done.report, done.statistics, session);
    session.result(done.result);
}

void run_edges(const EdgesOptions& o, Session& session) {
    const HighPassOptions& options = o.high_pass.options;
    const MemoryNeed need{"finding edges", 32.2};
    if (!session.team && options.stepper != Stepper::adi && o.files.preview.empty() &&
        in_blocks(o.files, need))
        return run_edges_in_blocks(o, session);
    Json seconds;
    Clock clock;
    FilterInput input = read_filter_input(o.files, need, high_pass_halo(options), session);
    MapFile& in = input.in;
    need_density(o.files.in, in);
    seconds["read"] = clock.lap();
    Preview preview;
    const bool shown = !o.files.preview.empty();
    if (shown) preview.add("before", in.map, Preview::Greys::own, session.stage("preview"));
    clock.lap();
    const HyperdiffusionReport r = o.checkpoints.run(session, [&] {
        return naming(o.files.in, [&] {
            return coupled_high_pass(*in.map.grid, options, session.stage("edges"), input.share(),
                                     o.checkpoints.options);
        });
    });
    clear_inactive(*in.map.grid);
    finish_map(input, history_of(options, r));
    seconds["compute"] = clock.lap();
    Json j = filter_result(o.files, in);
    add_result(options, r, j);
    j.update(statistics_json(in.map.statistics));
    if (shown) preview.add("edges", in.map, Preview::Greys::own, session.stage("preview"));
    clock.lap();
    write_filtered(o.files, input, r.bytes_sent, j, session);
    seconds["write"] = clock.lap();
    o.checkpoints.remove(session);
    if (shown) {
        preview.write(o.files.preview);
        j["preview"] = o.files.preview;
    }
    j["seconds"] = seconds;
    say_result(options, r, in.map.statistics, session);
    session.result(j);
}

}  // namespace

Command edges_command() {
    return {
        "edges", "Find the edges of a map: the difference of two coupled diffusions, a fast and a slow one",
        "  vdbgeo edges emd_1080.map edges.mrc --time 10", [](CLI::App& app) {
            auto o = std::make_shared<EdgesOptions>();
            o->high_pass.add(app);
            o->checkpoints.add(app);
            o->files.add(app,
                         "Map to write: .mrc .map .ccp4 .rec, .vdb or .nvdb; - is an MRC map for a pipe");
            o->files.add_preview(app, "Picture (PNG) of sections and power spectra of the map and its edges");
            return [o](Session& session) {
                o->files.finish();
                o->high_pass.finish();
                o->checkpoints.finish();
                if (session.team)
                    check_team_output(o->files, session);
                else
                    check_map_output(o->files.out, session);
                run_edges(*o, session);
            };
        }};
}

}  // namespace vdbgeo::app
