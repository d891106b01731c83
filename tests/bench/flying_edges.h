// VTK's flying edges on a dense array, where VTK was found.
#pragma once

#include "tests/bench/harness.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo::bench {

/// Triangles alone: neither normals nor gradients nor scalars. `values` is read in place and not copied.
Output flying_edges(std::vector<float>& values, const Frame& frame, double isovalue, int threads);

}  // namespace vdbgeo::bench
