#include <fmt/format.h>
#include <tbb/global_control.h>

#include <new>
#include <optional>

#include "apps/command.h"
#include "apps/reports.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {
namespace {

constexpr int exit_usage = 2, exit_input = 3, exit_io = 4, exit_computation = 5, exit_interrupted = 130;

int fail(const std::string& program, int code, const std::string& message) {
    std::string line = message;
    for (char& c : line)
        if (c == '\n' || c == '\r') c = ' ';
    fmt::print(stderr, "{}: error: {}\n", program, line);
    return code;
}

void add_common_flags(CLI::App& app, Session& session) {
    app.add_flag("--json", session.json, "Print the result as one JSON object on standard output");
    app.add_flag("-q,--quiet", session.quiet, "No progress");
    app.add_option("-j,--threads", session.threads, "Threads to use; the result does not depend on it [all]")
        ->check(CLI::Range(1, 4096));
}

/// Runs a command's body and turns what it throws into an exit code and one line.
int guarded(Session& session, const std::function<void(Session&)>& body, const TeamRun& team) {
    const auto failed = [&](int code, const std::string& message) {
        session.drop_stage();
        const auto say = [&] { fail(session.program, code, message); };
        team.fail ? team.fail(code, say) : say();
        return code;
    };
    try {
        std::optional<tbb::global_control> limit;
        if (session.threads > 0)
            limit.emplace(tbb::global_control::max_allowed_parallelism,
                          static_cast<std::size_t>(session.threads));
        openvdb::initialize();
        body(session);
        session.end_stage();
        return 0;
    } catch (const UsageError& e) {
        return failed(exit_usage, e.what());
    } catch (const InvalidInput& e) {
        return failed(exit_input, e.what());
    } catch (const IoError& e) {
        return failed(exit_io, e.what());
    } catch (const NumericalError& e) {
        return failed(exit_computation, e.what());
    } catch (const Cancelled& e) {
        return failed(exit_interrupted, e.what());
    } catch (const std::bad_alloc&) {
        return failed(exit_computation,
                      "out of memory; keep fewer voxels (--threshold) or use a smaller map");
    } catch (const std::exception& e) {
        return failed(exit_computation, e.what());
    }
}

}  // namespace

std::vector<Command> all_commands() {
    return {info_command(),           convert_command(),    phantom_command(),   denoise_command(),
            edges_command(),          transform_command(),  flow_command(),      surface_command(),
            remesh_command(),         simplify_command(),   smooth_command(),    repair_command(),
            measure_command(),        components_command(), curvature_command(), pockets_command(),
            tetrahedralize_command(), cutaway_command(),    validate_command(),  render_command(),
            model_command(),          report_command(),     merge_command()};
}

std::vector<Command> team_commands() {
    return {denoise_command(), edges_command(), flow_command(), surface_command(), model_command()};
}

int run(int argc, char** argv, const std::vector<Command>& commands, const std::string& program, bool single,
        const TeamRun& team) {
    install_interrupt_handler();
    CLI::App app(single ? commands[0].summary : "Geometric modelling of cryo-EM maps and tomograms", program);
    app.set_version_flag("--version", [] { return versions_text(); });
    app.get_formatter()->column_width(34);
    Session session;
    session.program = program;
    session.team = team.team;
    const bool has_the_word = !team.team || team.team->rank() == 0;
    std::function<void(Session&)> chosen;
    if (single) {
        add_common_flags(app, session);
        chosen = commands[0].define(app);
    } else {
        app.require_subcommand(0, 1);
        app.footer(
            "vdbgeo COMMAND --help tells the flags of a command. Exit codes: 0 done, 2 usage, 3 bad input,\n"
            "4 reading or writing failed, 5 the computation failed, 130 interrupted.");
        for (const Command& command : commands) {
            CLI::App* sub = app.add_subcommand(command.name, command.summary);
            sub->footer("Example:\n" + command.example);
            add_common_flags(*sub, session);
            const auto body = command.define(*sub);
            sub->callback([&chosen, body] { chosen = body; });
        }
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& e) {
        return has_the_word ? app.exit(e) : 0;  // --help, --version
    } catch (const CLI::ParseError& e) {
        if (!has_the_word) return exit_usage;
        return fail(program, exit_usage, fmt::format("{}; {} --help tells more", e.what(), program));
    }
    if (!chosen && !has_the_word) return exit_usage;
    if (!chosen)
        return fail(program, exit_usage, fmt::format("a command is needed; {} --help lists them", program));
    if (!has_the_word) session.silence();
    return guarded(session, chosen, team);
}

}  // namespace vdbgeo::app
