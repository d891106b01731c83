// How volume, area and pieces of a map's surface depend on the isovalue.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct IsovalueRow {
    double isovalue = 0;
    double volume_A3 = 0;          ///< of the voxels at or above the isovalue
    double area_A2 = 0;            ///< of the surface by marching cubes
    std::uint64_t components = 0;  ///< of that surface
};

struct IsovalueTableOptions {
    /// Rows; the isovalues are those between which the volume falls in equal ratios, and the given one if any.
    int rows = 16;
    std::optional<double> isovalue;

    void check() const;
};

std::vector<IsovalueRow> isovalue_table(const DensityMap& map, const IsovalueTableOptions& options = {},
                                        const Progress& progress = {});

}  // namespace vdbgeo
