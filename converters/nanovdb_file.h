// NanoVDB files (.nvdb): grids as one block of memory, for graphics cards.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <vector>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// Whether this build can write NanoVDB files (it needs NanoVDB's headers).
bool have_nanovdb();

/// Writes grids of floats and of float vectors to a NanoVDB file, whole or not at all (AtomicFile),
/// uncompressed, with the extremes of every node and a full checksum. Names, classes, transforms and voxels
/// are those of the grids; a NanoVDB file has no place for other metadata. The same bytes for the same grids.
///
/// Cost: each grid once more in memory, one after another. Throws InvalidInput for grids of other types and
/// in builds without NanoVDB, IoError; Cancelled.
void write_nanovdb(const std::vector<openvdb::GridBase::ConstPtr>& grids, const std::filesystem::path& path,
                   const Progress& progress = {});

bool is_nanovdb_ending(const std::filesystem::path& path);

}  // namespace vdbgeo
