// A part of a grid.
#pragma once

#include <openvdb/openvdb.h>

namespace vdbgeo {

/// Copies the leaves that touch `box`, with values, masks, background and transform. Active tiles become
/// leaves; what inactive ones have of the leaves' places that touch the box stays tiles.
openvdb::FloatGrid::Ptr part_of(const openvdb::FloatGrid& grid, const openvdb::CoordBBox& box);

/// The box that leaves which touch `box` take up.
openvdb::CoordBBox whole_leaves(const openvdb::CoordBBox& box);

/// Puts tiles into `to` where tiles of `from`, active ones and such as differ from the background of `to`,
/// reach into whole_leaves(box): of 8³ voxels, or larger where they fit in.
void copy_tiles(const openvdb::FloatTree& from, const openvdb::CoordBBox& box, openvdb::FloatTree& to);

}  // namespace vdbgeo
