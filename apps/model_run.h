// Runs the stages of a model, takes over what is there already, and keeps the summary.
#pragma once

#include "apps/model_options.h"
#include "apps/session.h"
#include "apps/team_lines.h"

namespace vdbgeo::app {

/// Runs the stages `options.from` … `options.to` in the folder, which is made where it is not there once the
/// map could be read, and writes summary.json after each: status, the command lines, results, files and
/// seconds. A stage whose command lines, program and input files are those of the last run (by hash), and
/// whose files are as it left them, is not run again unless `options.fresh`; stages before `from` are taken
/// as they are. Returns the summary.
///
/// Errors: what the commands throw, once the summary says so. A stage that is not essential may fail: the
/// others go on, and NumericalError is thrown at the end. UsageError for options that no stage knows;
/// InvalidInput where a file is missing that a stage before `from` should have left.
///
/// `run` runs the stages' command lines. In a team the noise removal draws no pictures.
Json run_model(const ModelOptions& options, Session& session, const RunLine& run);

}  // namespace vdbgeo::app
