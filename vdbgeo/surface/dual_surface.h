// The dual surface of a map (OpenVDB's volumeToMesh), adaptive where asked.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct DualSurfaceOptions {
    double isovalue = 0;
    /// 0: a vertex for each crossed cell; towards 1, flat parts get ever larger polygons.
    double adaptivity = 0;
    /// Where set: the surface is extracted only in the cells of the mask's active voxels (same indices as the
    /// map, whatever its transform), and open at their border.
    openvdb::BoolGrid::ConstPtr mask;

    void check() const;
};

/// The dual surface of a map (OpenVDB's tools::VolumeToMesh; the class of the grid plays no part) at samples
/// at or above the isovalue, which are inside: a vertex in each crossed cell, at the mean of the crossings of
/// its edges, one for each sheet; a quad around each crossed edge, cut along the diagonal that leaves the
/// better triangles. Normals point from dense to empty, in a mirrored frame too; positions in Å. A level set
/// (negative inside) is its own negative here: turn the faces over, as after marching_cubes.
///
/// Sides without length are collapsed and faces back to back taken away, and where sheets touch each gets
/// vertices of its own (core/split_non_manifold.h): the result is an oriented 2-manifold, closed where there
/// is no mask. What lies outside the box of a bounded map is empty, so that the surface closes half a voxel
/// or so outside. Samples that are not numbers are empty. Sheets may intersect each other, most at high
/// adaptivity: a vertex at the mean of crossings knows nothing of the next sheet
/// (measure/self_intersections.h).
///
/// Cost: some 0.3 µs a triangle and 100 bytes, and a copy of the tree where the background is dense, a sample
/// is not finite or lies outside the box. The same bytes for any number of threads. Throws InvalidInput for
/// an isovalue that is not finite, an adaptivity outside 0…1 and 2^32 triangles or more; Cancelled, between
/// the stages.
TriMesh dual_surface(const DensityMap& map, const DualSurfaceOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
