// Density maps from and to files, whatever their format.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "converters/mrc.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/grid_builder.h"

namespace vdbgeo {

struct MapReadOptions {
    MrcReadOptions mrc;        ///< how to read an MRC or CCP4 file
    SparsifyOptions sparsify;  ///< which samples to keep (of an MRC file; a VDB grid is taken as it is)
    /// Keep samples above the mean plus this many rms instead of above a fixed value; the file is then read
    /// twice.
    std::optional<double> threshold_sigma;
    /// Negate the samples of an MRC file: in raw tomograms what is dense is dark. Thresholds and statistics
    /// are then those of the negated values.
    bool invert = false;
    std::optional<std::string>
        grid;  ///< name of the grid in a VDB file; unset: "density", else the first of floats

    void check() const;
};

struct MapFile {
    DensityMap map;
    bool level_set = false;             ///< a VDB level set: inside is negative, the surface at 0
    std::vector<std::string> warnings;  ///< what is odd about the file, one line each
};

/// Reads a map: VDB by its signature, else MRC or CCP4. MRC sections stream through GridBuilder, the next
/// ones being read while the last are sorted into leaves: memory holds the kept leaves and two slabs. The
/// grid's metadata tell where it came from (`mrc_*`, `vdbgeo_history`). Errors as MrcReader and read_vdb;
/// Cancelled.
MapFile read_map(const std::filesystem::path& path, const MapReadOptions& options = {},
                 const Progress& progress = {});

/// What the sections of a map file hold, gone through once: the statistics over all samples. Of the options
/// those that choose samples to keep have no meaning.
Statistics mrc_statistics(const std::filesystem::path& path, const MapReadOptions& options = {},
                          const Progress& progress = {});

/// The same of the sections that `reader` has left; what is odd about compressed data, which shows only at
/// its end, is in reader.warnings() afterwards. Reads a pipe too.
Statistics mrc_statistics(MrcReader& reader, bool invert = false, const Progress& progress = {});

/// Endings that are taken for maps: .mrc .map .ccp4 .rec .st .mrcs and so on, each also with .gz, .bz2, .zst.
bool is_map_ending(const std::filesystem::path& path);
bool is_vdb_ending(const std::filesystem::path& path);

}  // namespace vdbgeo
