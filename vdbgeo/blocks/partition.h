// How a grid is shared out: slabs along y, or pencils along x.
#pragma once

#include <openvdb/openvdb.h>

#include <utility>
#include <vector>

#include "vdbgeo/core/team.h"
#include "vdbgeo/stencil/share.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {

/// Shares out the cells (32 voxels along y, 128 along z, all of x) that a box of voxels touches: `parts[0]`
/// ranges of cells along y times `parts[1]` along z, each as long as the others or one cell longer. Parts are
/// numbered with z fastest. InvalidInput where there are more parts along an axis than cells.
std::vector<openvdb::CoordBBox> partition(const openvdb::CoordBBox& box, const std::pair<int, int>& parts);

/// Parts along y and z for so many members: of all ways that have a cell for everybody, the one whose largest
/// part is smallest, and of these the one with the least border between parts. InvalidInput where the box has
/// too few cells.
std::pair<int, int> parts_for(const openvdb::CoordBBox& box, int members);

/// The boxes of a partition without an outer border: those at an end along an axis go on to the end of the
/// indices, so that every voxel lies in one box.
std::vector<openvdb::CoordBBox> without_border(std::vector<openvdb::CoordBBox> boxes);

}  // namespace vdbgeo
