// A command as a step of another.
#pragma once

#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/session.h"

namespace vdbgeo::app {

/// The command of that name.
Command find_command(const std::string& name);

/// UsageError unless the command `words[0]` takes the other words and finds sense in them. Reads no file that
/// is not named as an option's value, and writes none.
/// `team`: as its members would.
void check_words(const std::vector<std::string>& words, Team* team = nullptr);

/// Runs a command line in this process and returns its result and its warnings. It throws what the command
/// throws. `name` is shown with its progress. `team`: it is run by all its members, which call this alike.
Session::Kept run_words(const std::vector<std::string>& words, const std::string& name,
                        const Session& session, Team* team = nullptr);

/// The words as one would type them: quoted for a shell where that is needed.
std::string command_line(const std::string& program, const std::vector<std::string>& words);

}  // namespace vdbgeo::app
