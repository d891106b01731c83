// How a grid is shared out: slabs along y, or pencils that run along x.
#pragma once

#include <openvdb/openvdb.h>

#include <utility>
#include <vector>

namespace vdbgeo {

/// Shares out a box of voxels, rounded to units of 8 voxels along y and 128 along z, and all of x:
/// `parts.first` ranges of units along y times `parts.second` along z, each as long as the others or one unit
/// longer. Parts are numbered with z fastest. InvalidInput where there are more parts along an axis than
/// units.
std::vector<openvdb::CoordBBox> partition(const openvdb::CoordBBox& box, const std::pair<int, int>& parts);

/// Parts along y and z for so many members: of all ways that have a unit for everybody, the one whose largest
/// part, with eight ghosts around, is smallest. InvalidInput where the box has too few units.
std::pair<int, int> parts_for(const openvdb::CoordBBox& box, int members);

/// The boxes of a partition without an outer border: those at an end along an axis go on to the end of the
/// indices, so that every voxel lies in one box.
std::vector<openvdb::CoordBBox> without_border(std::vector<openvdb::CoordBBox> boxes);

}  // namespace vdbgeo
