// Another map on the voxels of a first one: a mask, a local resolution, a label.
#pragma once

#include <string>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct SampleOptions {
    /// Only those of the reference's active voxels that are active here too, index for index; unset: all.
    openvdb::BoolGrid::ConstPtr within;
};

struct SampledMap {
    openvdb::FloatGrid::Ptr grid;
    bool by_index = false;       ///< index for index, since both boxes have the same size; else by position
    bool frames_differ = false;  ///< by index, though the two files place their voxels differently
    std::uint64_t outside =
        0;  ///< by position: voxels of the first map that lie outside the box of the other
};

/// The values of `other` on the active voxels of `reference`, as a grid `name` with the reference's transform
/// and box; what is not active has the background of `other`.
///
/// Boxes of the same size: sample for sample, whatever the headers say of their place, because maps that
/// belong together (a mask, a local resolution) often have a header that was never set; `frames_differ` tells
/// where they disagree by over a thousandth of a voxel at any corner. Else, or where a box is unbounded: the
/// trilinear interpolation of `other` at the world position of each voxel; outside its box it reads as its
/// background.
///
/// Cost: one pass over the active voxels. Throws InvalidInput for a name that is empty; Cancelled.
SampledMap sample_on(const DensityMap& other, const DensityMap& reference, const std::string& name,
                     const SampleOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
