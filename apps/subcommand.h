// A command as a step of another.
#pragma once

#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/session.h"

namespace vdbgeo::app {

/// The command of that name.
Command find_command(const std::string& name);

/// Runs a command line as far as its first stage: what it throws until then is thrown. Of a map it reads the
/// header at most, or where leaves lie, and it writes nothing. `team`: as its members would.
void rehearse(const std::vector<std::string>& words, Team* team = nullptr);

/// UsageError unless the command `words[0]` takes the other words and finds sense in them. Its input need not
/// be there yet.
void check_words(const std::vector<std::string>& words);

/// Runs a command line in this process and returns its result and its warnings. It throws what the command
/// throws. `name` is shown with its progress. `team`: it is run by all its members, which call this alike.
Session::Kept run_words(const std::vector<std::string>& words, const std::string& name,
                        const Session& session, Team* team = nullptr);

/// The words as one would type them: quoted for a shell where that is needed.
std::string command_line(const std::string& program, const std::vector<std::string>& words);

}  // namespace vdbgeo::app
