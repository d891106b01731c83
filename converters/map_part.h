// A part of a map file, for one member of a team.
#pragma once

#include "converters/map_file.h"
#include "vdbgeo/core/team.h"

namespace vdbgeo {

/// Where a part lies, in indices of the map as it is handed out (after crop and bin), ends included.
struct MapPart {
    Team* team = nullptr;
    openvdb::CoordBBox own;     ///< boxes of all members cover the map, each voxel once; at multiples of 8
    openvdb::CoordBBox wanted;  ///< own box and ghosts: leaves and tiles that reach into it are kept
    /// What a VDB grid has outside its box does not count, as in surfaces; else active voxels outside the
    /// leaves that touch the box are InvalidInput.
    bool box_only = false;
};

/// The frame of the map that read_map_part would read parts of: the header is all that is looked at, of a VDB
/// file where its leaves lie. Its grid has to be bounded.
Frame map_frame(const std::filesystem::path& path, const MapReadOptions& options = {});

/// The leaves of read_map that lie in a part, to the same bits; frame, statistics, background, metadata,
/// notes and warnings are those of the whole map. All members call it. Of a plain MRC file whose rows or
/// sections run along y each member reads the rows of its part; what needs a pass of its own over the samples
/// (statistics, percentile, selection) every member does by itself. Of a VDB file, or of a folder of parts,
/// each notes where all leaves lie, and decodes those of its part; active tiles become leaves.
MapFile read_map_part(const std::filesystem::path& path, const MapReadOptions& options, const MapPart& part,
                      const Progress& progress = {});

}  // namespace vdbgeo
