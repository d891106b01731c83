// The map as vdbgeo works on it: a sparse OpenVDB grid, where it lies in the world, and its statistics.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <limits>
#include <string>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Where the samples of a map lie: world = origin + axes · index, in Å, voxel centres at integer indices.
/// Skewed cells and anisotropic voxels are in `axes`; nothing is ever resampled.
struct Frame {
    Mat3d axes = Mat3d::Identity();  ///< column a: one index step along axis a (x, y, z), in Å
    Vec3d origin = Vec3d::Zero();    ///< world position of index (0,0,0), in Å
    Vec3i size = Vec3i::Zero();      ///< samples along x, y, z; all zero: unbounded (a grid without a box)

    bool bounded() const { return size.minCoeff() > 0; }
    Vec3d to_world(const Vec3d& index) const { return origin + axes * index; }
    /// Lengths of the three index steps, in Å.
    Vec3d voxel_size() const { return axes.colwise().norm().transpose(); }
    /// Volume of one voxel, in Å³.
    double voxel_volume() const { return std::abs(axes.determinant()); }
};

/// Statistics over every sample of a map, the dropped ones included. `rms` is the deviation from the mean, as
/// in the MRC header. Samples that are NaN or infinite are counted apart and left out of the rest.
struct Statistics {
    std::uint64_t count = 0;
    std::uint64_t non_finite = 0;
    double min = std::numeric_limits<double>::infinity();
    double max = -std::numeric_limits<double>::infinity();
    double mean = 0;
    double rms = 0;
};

/// A density map. Index (0,0,0) of `grid` is the first sample after the file's axes were put into x, y, z
/// order; indices inside `frame.size` that are not active were dropped and read as their stored value (the
/// background: the solvent level). Where it came from and what was done to it stands in the grid's metadata:
/// `mrc_*` for the file it was read from, `vdbgeo_*` for every operation with its options.
struct DensityMap {
    openvdb::FloatGrid::Ptr grid;
    Frame frame;
    Statistics statistics;
};

/// The frame of a linear transform, unbounded; InvalidInput where the transform is not linear (a frustum) or
/// singular.
Frame frame_of(const openvdb::math::Transform& transform);

/// The transform of a frame: the simplest kind of map that holds it to the last bit (uniform scale, scale,
/// affine).
openvdb::math::Transform::Ptr transform_of(const Frame& frame);

/// Writes the frame and the statistics into the grid's transform and metadata, so that they survive a VDB
/// file, to the last bit. Throws InvalidInput for a frame that is not finite, and for voxels of 3e-15 Å³ or
/// less, flat ones among them.
void store_frame(DensityMap& map);

/// The inverse of store_frame for a grid from any source: a frame from the transform (InvalidInput where it
/// is not linear), the box and the statistics from the metadata where they are there, else unbounded and
/// computed from the active voxels.
DensityMap map_from_grid(const openvdb::FloatGrid::Ptr& grid);

/// Appends one line to the grid's record of what was done to it (metadata `vdbgeo_history`).
void add_history(openvdb::GridBase& grid, const std::string& line);

}  // namespace vdbgeo
