// A part of a grid.
#pragma once

#include <openvdb/openvdb.h>

namespace vdbgeo {

/// Copies the leaves that touch `box`, with values, masks, background and transform. Active tiles become
/// leaves; inactive ones that touch the box stay tiles.
openvdb::FloatGrid::Ptr part_of(const openvdb::FloatGrid& grid, const openvdb::CoordBBox& box);

}  // namespace vdbgeo
