// Command-line flags bound to the options structs: a default stands once, in the struct.
#pragma once

#include <CLI/CLI.hpp>

#include <string>

#include "converters/map_file.h"
#include "converters/vdb_file.h"
#include "vdbgeo/view/render.h"
#include "vdbgeo/volume/isovalue.h"

namespace vdbgeo::app {

/// Flags whose text is turned into options once all are parsed.
struct MapFlags {
    MapReadOptions options;
    std::string quantise, threshold, origin = "auto", mode0 = "auto", voxel_size, crop, memory;
    std::optional<double> keep_fraction;

    /// How a map is read: frame, modes, volume, grid.
    void add_reading(CLI::App& app);
    /// Which samples are kept.
    void add_sparsify(CLI::App& app);
    /// How much memory may be taken.
    void add_memory(CLI::App& app);
    /// Turns texts into options; throws UsageError.
    void finish();
};

struct IsoFlag {
    std::string text = "auto";
    void add(CLI::App& app);
    Isovalue parse() const;
};

/// UsageError where one of these flags was given: `why` tells what it belongs to.
void refuse_flags(const CLI::App& app, const std::vector<std::string>& names, const std::string& why);

/// A number of bytes: "2G", "256M", "1048576"; a K is 1024. UsageError for anything else.
std::uint64_t parse_bytes(const char* flag, const std::string& text);

/// A length: "0.8" is in `unit` (voxels, say), "1.5A" in Å; tells whether it was in Å. An empty text leaves
/// `length` as it is. UsageError for what is no length above 0.
bool parse_length(const char* flag, const char* unit, const std::string& text, double& length);

void add_vdb_flags(CLI::App& app, VdbWriteOptions& options);
void add_render_flags(CLI::App& app, RenderOptions& options);

/// Runs an options check and turns what it finds into a usage error.
template <class Options>
void check_usage(const Options& options);

}  // namespace vdbgeo::app

#include "apps/session.h"
#include "vdbgeo/core/errors.h"

template <class Options>
void vdbgeo::app::check_usage(const Options& options) {
    try {
        options.check();
    } catch (const InvalidInput& e) {
        throw UsageError(e.what());
    }
}
