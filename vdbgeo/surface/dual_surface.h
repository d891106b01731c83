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
    /// Where set: the surface is extracted only where the mask is active (same indices as the map).
    openvdb::BoolGrid::ConstPtr mask;

    void check() const;
};

/// Triangles, normals from dense to empty, non-manifold spots split (core/split_non_manifold.h).
TriMesh dual_surface(const DensityMap& map, const DualSurfaceOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
