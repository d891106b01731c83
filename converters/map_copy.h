// A map file → another map file, section by section.
#pragma once

#include "converters/map_options.h"
#include "converters/mrc.h"

namespace vdbgeo {

struct MapCopy {
    MrcWriteReport report;
    Frame frame;
    std::vector<std::string> warnings, notes;
};

/// Writes the samples of the map file `in`, cropped, binned, scaled and chosen as `read` says, to the map
/// file `out`: what is not kept becomes the background. The bytes are those that read_map and write_mrc would
/// make, but nothing of the map stays in memory: a few sections do, as many as fit into an eighth of
/// MapReadOptions::memory. Goes through `in` once more than otherwise where samples are dropped and no
/// background is given. Errors as read_map and write_mrc; NumericalError where no sample is kept.
MapCopy copy_map(const std::filesystem::path& in, const std::filesystem::path& out,
                 const MapReadOptions& read, const MrcWriteOptions& write, const Progress& progress = {});

}  // namespace vdbgeo
