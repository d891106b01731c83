// Statistics of a map whose values changed, and how much they did.
#pragma once

#include "vdbgeo/volume/density_map.h"
#include "vdbgeo/volume/sparsify.h"

namespace vdbgeo {

/// The statistics over every sample of a map as it reads now: inside the box the dropped ones too, with their
/// stored value; of a map without a box the active voxels. Same bits for any number of threads. Cost: one
/// pass.
Statistics statistics_of(const DensityMap& map);

/// Count, mean and squared deviations of the active values alone.
Moments active_moments(const openvdb::FloatGrid& grid);

/// √(mean over the active voxels of a of (a − b)²); 0 without any.
double rms_difference(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b);

}  // namespace vdbgeo
