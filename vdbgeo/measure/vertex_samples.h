// Values of a map at the vertices of a mesh.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct VertexSampleOptions {
    double offset = 0;  ///< Å along the outward normal from the vertex (negative: inside)
    double mean_over =
        0;  ///< Å: mean over this length along the normal, centred on the offset; 0: one sample
    void check() const;
};

/// A map's trilinear value at each vertex (local resolution, density, another map …), as a property of one
/// component. NaN where the map's box does not reach.
MeshProperty sample_at_vertices(const TriMesh& mesh, const DensityMap& map, const std::string& name,
                                const VertexSampleOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
