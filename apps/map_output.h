// What goes into a map file: its flags, what is said of it, and grids that become one without being loaded.
#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

#include "apps/session.h"
#include "converters/map_options.h"
#include "converters/mrc.h"

namespace vdbgeo::app {

/// --compress and --scale.
void add_map_output_flags(CLI::App& app, MrcWriteOptions& options);

/// Puts `scaling` (factor, offset, largest_error) into the result of a command that wrote a map file, and
/// says how stored numbers become densities where they are not the same.
void report_written(const std::string& path, const MrcWriteReport& report, Json& result, Session& session);

/// Writes a grid of a VDB file as a map file without loading it: its leaves are decoded slab by slab. The
/// bytes are those that read_map and write_map give.
Json convert_grid_to_map(const std::string& in, const std::string& out,
                         const std::optional<std::string>& grid, const MrcWriteOptions& options,
                         Session& session);

/// Writes a map file as another one, a few sections at a time.
Json convert_map_to_map(const std::string& in, const std::string& out, const MapReadOptions& read,
                        const MrcWriteOptions& write, Session& session);

}  // namespace vdbgeo::app
