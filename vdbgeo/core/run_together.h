// Steps that fail at all members of a team where they fail at one.
#pragma once

#include <functional>

#include "vdbgeo/core/team.h"

namespace vdbgeo {

/// Runs a step that may fail at some members and not at others, such as one that writes a file. Where it
/// threw at any of them, all throw what it threw at the first of these, and so no one waits for who is gone.
/// Returns once all have come so far. The step itself must not call the team.
void run_together(Team& team, const std::function<void()>& step);

}  // namespace vdbgeo
