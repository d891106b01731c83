// The surface of a map by restricted Delaunay refinement (CGAL): every triangle well shaped.
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The three bounds of the paper's §2.3 (30°, 0.8, 0.8 there).
struct DelaunaySurfaceOptions {
    double isovalue = 0;
    double angle_deg = 30;  ///< least angle of a triangle; up to 30 the refinement is sure to end
    double radius = 0.8;    ///< largest radius of a triangle's surface Delaunay ball, in voxels
    double distance =
        0.8;  ///< largest distance from a triangle's circumcentre to its ball's centre, in voxels
    std::uint64_t max_vertices = 20'000'000;
    double max_seconds = 3600;

    void check() const;
};

/// Whether this build has CGAL.
bool have_delaunay();

TriMesh delaunay_surface(const DensityMap& map, const DelaunaySurfaceOptions& options,
                         const Progress& progress = {});

}  // namespace vdbgeo
