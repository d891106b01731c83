// What the commands share that make a map out of a map: flags, reading, the memory they may take, writing.
#pragma once

#include <CLI/CLI.hpp>

#include <string>

#include "apps/flags.h"
#include "apps/session.h"
#include "converters/map_file.h"
#include "converters/mrc.h"
#include "converters/vdb_file.h"
#include "vdbgeo/volume/sparsify.h"

namespace vdbgeo::app {

struct MapFilterFlags {
    std::string in, out, preview;
    MapFlags map;
    VdbWriteOptions vdb;
    MrcWriteOptions mrc;

    /// IN, OUT with this description, and all flags of reading, choosing samples, memory and writing.
    void add(CLI::App& app, const std::string& out_text);
    /// --preview with this description.
    void add_preview(CLI::App& app, const std::string& text);
    /// Turns texts into options; throws UsageError.
    void finish();
};

/// Samples of a map file, by its header alone. Nothing where that does not tell; where a threshold or a mask
/// leaves some out, only if `all` are asked for.
std::optional<double> samples_in_file(const MapFilterFlags& flags, bool all);

/// What a command takes, in bytes a voxel of active leaves, the grid among it.
struct MemoryNeed {
    std::string doing;  ///< "denoising"
    double bytes_a_voxel = 0;
};

/// Reads the map and says what is odd about it. Before and after, what the command will take is compared with
/// --memory. Throws what read_map does; NumericalError where no sample is kept or the memory does not
/// suffice; InvalidInput where a sample that is kept is not a finite number.
MapFile read_for_filter(const MapFilterFlags& flags, const MemoryNeed& need, Session& session);

/// InvalidInput where a sample that is kept is not a finite number; NumericalError where none is kept.
void need_samples(const std::string& name, const Moments& kept, const Statistics& of_map);

/// InvalidInput for a level set, which is no density.
void need_density(const std::string& name, const MapFile& in);

/// Makes metadata and history of a map, whose statistics are known, those of its new values.
void note_new_values(DensityMap& map, const std::string& history);

/// The same, and the statistics too.
void finish_map(DensityMap& map, const std::string& history);

/// Writes the map and puts what there is to say of the file into the result.
void write_filtered(const MapFilterFlags& flags, const DensityMap& map, Json& result, Session& session);

/// in, out, warnings and notes, with which a result begins.
Json filter_result(const MapFilterFlags& flags, const MapFile& in);

/// Gives every inactive voxel the value 0: for maps of differences, where nothing was taken into account.
void clear_inactive(openvdb::FloatGrid& grid);

}  // namespace vdbgeo::app
