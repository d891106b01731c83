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
    std::uint64_t components = 0;  ///< of that surface, connected through vertices
};

struct IsovalueTableOptions {
    /// Rows, 2…1000; the isovalues are those between which the volume falls in equal ratios, and the given
    /// one if any.
    int rows = 16;
    /// An isovalue that gets a row of its own, whatever lies there.
    std::optional<double> isovalue;
    /// The least isovalue encloses this share of the samples, 0…1; of a sparse map at most half of what is
    /// above the background.
    double largest_share = 0.1;
    /// Rows whose surface would have more triangles than about so many are left out: deep in the noise of a
    /// large map a surface says nothing and takes gigabytes. They are counted before, by how often a row of
    /// samples crosses the isovalue.
    std::uint64_t max_triangles = 20'000'000;

    void check() const;
};

/// The table, from the highest isovalue, which encloses 8 voxels, to the lowest. The levels are found
/// exactly, by one selection for all rows (volume/enclosing_level.h); where many samples are equal rows
/// coincide and are given once. Inside a box the samples are all that it holds, dropped ones included, and
/// the surface is open at its border; without a box they are the active voxels above the background.
///
/// Throws InvalidInput for a level set (it holds distances, and no density), for a map that has no two
/// different values and for options out of range; Cancelled. Cost: two passes over the samples, one more to
/// count crossings, and a run of marching cubes for each row. The same for any number of threads.
std::vector<IsovalueRow> isovalue_table(const DensityMap& map, const IsovalueTableOptions& options = {},
                                        const Progress& progress = {});

}  // namespace vdbgeo
