// A command of `vdbgeo`: its name, its flags, what it does. One file a command; the table is in commands.cpp.
#pragma once

#include <CLI/CLI.hpp>

#include <functional>
#include <string>
#include <vector>

#include "apps/session.h"

namespace vdbgeo::app {

struct Command {
    std::string name;
    std::string summary;  ///< one line
    std::string example;  ///< lines shown under the help
    /// Adds the flags to `app` and returns what runs once they are parsed.
    std::function<std::function<void(Session&)>(CLI::App& app)> define;
};

Command info_command();
Command convert_command();
Command phantom_command();
Command denoise_command();
Command edges_command();
Command transform_command();
Command flow_command();
Command surface_command();
Command components_command();
Command remesh_command();
Command simplify_command();
Command smooth_command();
Command repair_command();
Command measure_command();
Command curvature_command();
Command pockets_command();
Command tetrahedralize_command();
Command cutaway_command();
Command validate_command();
Command render_command();
Command model_command();
Command report_command();

/// Every command, in the order of the help.
std::vector<Command> all_commands();

Command merge_command();

/// The commands that a team can run.
std::vector<Command> team_commands();

/// What a member of a team needs beside its part.
struct TeamRun {
    Team* team = nullptr;
    /// Ends all members with this exit code; the one that has the word calls `say`.
    std::function<void(int code, const std::function<void()>& say)> fail;
};

/// Runs `vdbgeo` with all commands, or, with `only` set, a program that is that one command under another
/// name. Returns the exit code: 0 done, 2 usage, 3 bad input, 4 reading or writing failed, 5 the computation
/// failed, 130 interrupted.
int run(int argc, char** argv, const std::vector<Command>& commands, const std::string& program, bool single,
        const TeamRun& team = {});

}  // namespace vdbgeo::app
