// Which grid of a VDB file is meant, and whether what it holds is what its metadata tell.
#pragma once

#include "converters/vdb_skeleton.h"

namespace vdbgeo {

/// The bounding box that the writer noted has to be a box of plausible size: InvalidInput.
void check_noted_box(const std::string& file, const VdbGridInfo& grid);

/// The active voxels that were found have to be those that the metadata tell of: InvalidInput.
void check_voxels(const std::string& file, const VdbGridInfo& grid, std::uint64_t count,
                  const openvdb::CoordBBox& box);

/// The grid of floats called `name`; unset: "density", else the first grid of floats. InvalidInput where
/// there is none.
const VdbEntry& choose_vdb_grid(const std::string& file, const std::vector<VdbEntry>& grids,
                                const std::optional<std::string>& name);

/// The grid whose tree `entry` has: itself, or the one that it is an instance of.
const VdbEntry& owner_of_tree(VdbCursor& cursor, const std::vector<VdbEntry>& grids, const VdbEntry& entry);

}  // namespace vdbgeo
