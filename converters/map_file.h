// Density maps from and to files, whatever their format.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "converters/map_options.h"
#include "converters/vdb_file.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/grid_builder.h"

namespace vdbgeo {

struct MapFile {
    DensityMap map;
    bool level_set = false;             ///< a VDB level set: inside is negative, the surface at 0
    std::vector<std::string> warnings;  ///< what is odd about the file, one line each
    std::optional<float> quantisation;  ///< the step that values were rounded to
    RoundingError rounding;             ///< what that cost
    RoundingError half_error;           ///< what storing them as 16-bit floats costs (stream_map)
    std::vector<std::string> notes;     ///< what was done that the user may want to know, one line each
};

/// Reads a map: VDB by its signature, a folder of parts (MapParts), else MRC or CCP4. MRC samples stream into
/// leaves while the next ones are being read: memory holds the kept leaves and little else. The grid's
/// metadata tell where it came from (`mrc_*`, `vdbgeo_history`). What is written back after samples became
/// other numbers (binning, scales) has mode 2. Errors as MrcReader, StripSource, read_vdb and MapParts;
/// Cancelled.
MapFile read_map(const std::filesystem::path& path, const MapReadOptions& options = {},
                 const Progress& progress = {});

/// The same for an MRC file that is to become a VDB file, within MapReadOptions::memory: the grid has no tree
/// (StreamedGrid) and is good for nothing but its counts, metadata and write_vdb, with the same options. The
/// bytes of the file are those that read_map and write_vdb would make.
MapFile stream_map(const std::filesystem::path& path, const MapReadOptions& options,
                   const VdbWriteOptions& vdb, const Progress& progress = {});

/// The statistics over all samples of a map file, gone through once. Of the options those that choose samples
/// to keep or change their scale have no meaning.
Statistics mrc_statistics(const std::filesystem::path& path, const MapReadOptions& options = {},
                          const Progress& progress = {});

/// Endings that are taken for maps: .mrc .map .ccp4 .rec .st .mrcs and so on, each also with .gz, .bz2, .zst.
bool is_map_ending(const std::filesystem::path& path);
bool is_vdb_ending(const std::filesystem::path& path);

}  // namespace vdbgeo
