// What goes into a map file: its flags, what is said of it, and grids that become one without being loaded.
#pragma once

#include <CLI/CLI.hpp>

#include <string>

#include "apps/session.h"
#include "converters/mrc.h"

namespace vdbgeo::app {

/// --compress and --scale.
void add_map_output_flags(CLI::App& app, MrcWriteOptions& options);

/// Puts `scaling` (factor, offset, largest_error) into the result of a command that wrote a map file, and
/// says how stored numbers become densities where they are not the same.
void report_written(const std::string& path, const MrcWriteReport& report, Json& result, Session& session);

}  // namespace vdbgeo::app
