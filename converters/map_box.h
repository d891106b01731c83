// The leaves of a box of an MRC file, once MapPasses has made the passes before.
#pragma once

#include <functional>

#include "converters/map_passes.h"

namespace vdbgeo {

/// Hands the leaves and tiles of the map that touch `wanted` to `builder`. Of a plain file no rows are read
/// but those of the box; what lies beside it along the rows is passed over.
///
/// `seen`, where given, gets every strip that reaches into the box, with the totals of all its columns.
using SeenStrip = std::function<void(int slab, int row, const SortedStrip& strip)>;
void sort_box(MapPasses& passes, const openvdb::CoordBBox& wanted, GridBuilder& builder,
              const SeenStrip& seen = {}, const Progress& progress = {});

}  // namespace vdbgeo
