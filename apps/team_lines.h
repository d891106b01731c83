// A command of steps that a team runs: one member leads, and the others help with what a team can do.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/session.h"

namespace vdbgeo::app {

/// Runs a command line as a step: run_words, or that of a team.
using RunLine = std::function<Session::Kept(const std::vector<std::string>& words, const std::string& name)>;

/// Calls `body` at the first member of the session's team, with what runs lines for it: those that a team can
/// run all members run, and the others the first alone, while the rest sleeps. Without a team it is the
/// first. Where the body throws, all throw.
void lead_or_follow(Session& session, const std::function<void(const RunLine& run)>& body);

}  // namespace vdbgeo::app
