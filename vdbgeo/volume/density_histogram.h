// How often which density occurs in a map.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// counts[i] voxels have a density in [low + i·w, low + (i+1)·w), w = (high − low)/bins; the last bin has its
/// upper end too.
struct DensityHistogram {
    double low = 0, high = 0;
    std::vector<std::uint64_t> counts;
    std::uint64_t voxels = 0;      ///< the sum of the counts
    std::uint64_t non_finite = 0;  ///< left out
};

/// Of the active voxels: all samples of a map file, what was kept of a sparse one. From the least to the
/// greatest density in `bins` equal bins; where the densities are levels with one distance between them (maps
/// of integers, scaled or not; up to 1024 levels, whole numbers any) a bin holds a whole number of levels,
/// `bins` at most, with the levels in the middle of their part: else some bins would hold one level more than
/// their neighbours. One value alone has a bin to itself. Errors: InvalidInput without any voxel and for 0
/// bins; Cancelled. The same for any number of threads. Cost: two passes.
DensityHistogram density_histogram(const DensityMap& map, std::size_t bins, const Progress& progress = {});

}  // namespace vdbgeo
