// Values of a map at the vertices of a mesh.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct VertexSampleOptions {
    /// Å along the outward normal from the vertex (negative: inside). 0: at the vertex.
    double offset = 0;
    /// Å, 0 or more: mean over this length along the normal, centred on the offset. 0: one sample.
    double mean_over = 0;
    void check() const;
};

/// A map's trilinear value at each vertex (local resolution, density, another map …), as a property `name`
/// of one component. The map may have any frame: places are world positions in Å. What the sparse grid does
/// not hold reads as its background. NaN where the box of a bounded map does not reach (a thousandth of a
/// voxel is forgiven: coordinates are floats), and where a sample that counts is not finite.
///
/// The outward normal at a vertex is the sum of its faces' areas as vectors, caps left out where other faces
/// are. It is asked for only where `offset` or `mean_over` is not 0; vertices without one (no face with an
/// area) are NaN then. The mean is the trapezoid rule in equal steps of at most half a voxel: exact for a
/// field that is linear. It is NaN where any of its places is.
///
/// Any mesh that check() accepts: open, in parts, not manifold. Throws InvalidInput for others, for an empty
/// name, for options that are not finite, and for a mean over more than 1000 steps; Cancelled. Some 50 ns a
/// sample and thread.
MeshProperty sample_at_vertices(const TriMesh& mesh, const DensityMap& map, const std::string& name,
                                const VertexSampleOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
