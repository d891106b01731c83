// Marching cubes on a sparse grid, with the topology of the trilinear interpolant.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct MarchingCubesOptions {
    /// The level to extract, in the map's units. Samples at or above it (as 32-bit floats) are inside.
    double isovalue = 0;

    void check() const;
};

/// The level set {u = isovalue} of the trilinear interpolant of a map's samples, as triangles in Å.
///
/// The map is the function that its grid stores: active voxels, inactive voxels and tiles alike. In a bounded
/// frame the cells between its samples are extracted, and the surface is open where it meets the border of
/// the box; an unbounded grid goes on as background for ever, and its surface is closed. Everywhere else the
/// surface is a closed, oriented 2-manifold with the topology of the trilinear interpolant in every cell:
/// faces by the asymptotic decider (Nielson & Hamann, Visualization '91), the inside by an exact sweep
/// (cell_topology.h; it settles what Chernyaev's Marching Cubes 33, CERN CN/95-17, settles by tests). Normals
/// point from dense to empty, in a mirrored frame too. A map of one layer has no cells and no surface.
///
/// A vertex lies on a grid edge, at the linear interpolation of the edge's two samples but at least 1/1024 of
/// the edge from either end, so that no two vertices coincide where a sample equals the isovalue. It is
/// numbered by the leaf that owns the edge: no hash, and the same bytes for any number of threads. Samples
/// that are not a number count as empty. A few cells need extra vertices inside.
///
/// Cost: one read of the leaves, then time and memory in proportion to the 8³ blocks that the surface crosses
/// (about 0.4 KB each beside the mesh). An isovalue that nothing crosses gives an empty mesh. Throws
/// InvalidInput for an isovalue that is not finite, for a mesh of 2^32 vertices or more and for an unbounded
/// grid with nodes at the very end of the 32-bit indices; Cancelled.
TriMesh marching_cubes(const DensityMap& map, const MarchingCubesOptions& options,
                       const Progress& progress = {});

}  // namespace vdbgeo
