// Delaunay remeshing of a closed mesh (the paper's Fig 8).
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct DelaunayRemeshOptions {
    double angle_deg = 30;
    double radius = 0;    ///< Å; must be given
    double distance = 0;  ///< Å; must be given
    std::uint64_t max_vertices = 20'000'000;
    double max_seconds = 3600;

    void check() const;
};

TriMesh delaunay_remesh(const TriMesh& mesh, const DelaunayRemeshOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
