// A density map as a fog volume: 0 (clear) to 1 (opaque), for programs that render smoke.
#pragma once

#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"
#include "vdbgeo/volume/isovalue.h"

namespace vdbgeo {

/// Which densities become 0 and 1.
struct FogOptions {
    /// At or below this level the fog is 0. Unset: mean + 2 rms, but not above the middle between mean and
    /// maximum (in a mask, say, 2 rms lie beyond the maximum).
    std::optional<Isovalue> low;
    /// At or above this level the fog is 1. Unset: the map's maximum.
    std::optional<Isovalue> high;

    void check() const;
};

/// The two levels in the map's units.
struct FogRange {
    double low = 0, high = 1;
};

/// The levels that the options mean for a map with these statistics. Throws InvalidInput unless both are
/// finite and low < high.
FogRange fog_range(const Statistics& statistics, const FogOptions& options = {});

/// (v - low) / (high - low), clipped to 0…1, of every sample v of the map, as a fog volume `density`: voxels
/// at or below `low`, dropped ones and those that are no numbers are inactive and 0, as is the background.
/// What is inactive but above `low` and not background (the inside of a band) is dense and becomes active.
/// Voxels and transform are the map's; blocks of one value become tiles.
///
/// The metadata keep `vdbgeo_fog_low` and `vdbgeo_fog_high`, so that density = low + fog · (high - low) where
/// it was not clipped. Cost: a copy of the map's tree. Throws InvalidInput for a level set, which has no
/// density, and for a range that fog_range refuses; Cancelled.
openvdb::FloatGrid::Ptr fog_volume(const DensityMap& map, const FogRange& range,
                                   const Progress& progress = {});
openvdb::FloatGrid::Ptr fog_volume(const DensityMap& map, const FogOptions& options = {},
                                   const Progress& progress = {});

}  // namespace vdbgeo
