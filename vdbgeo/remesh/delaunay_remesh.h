// Delaunay remeshing of a closed mesh (the paper's Fig 8).
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct DelaunayRemeshOptions {
    double angle_deg = 30;  ///< least angle of a triangle, up to 30
    double radius = 0;      ///< largest radius of a triangle's surface Delaunay ball, Å; must be given
    double distance = 0;    ///< largest distance from a circumcentre to its ball's centre, Å; must be given
    std::uint64_t max_vertices = 20'000'000;
    double max_seconds = 3600;

    void check() const;
};

/// A new mesh of the surface of `mesh`, as restricted Delaunay refinement makes one (delaunay_surface.h): its
/// vertices lie on the input's faces, its angles are at least the bound (but for balls under 1/16384 of the
/// radius, at creases), every component of the input is there, cavities too, and normals point out of the
/// solid. Creases and corners sharper than the bounds are rounded off within them. Properties are not kept.
///
/// Throws InvalidInput for an option out of range, for a mesh that is open, not consistently oriented or not
/// a manifold, and where this build has no CGAL; NumericalError where a cap is reached or a component cannot
/// be meshed; Cancelled. An empty mesh gives an empty mesh. Cost: about 0.1 ms a vertex made.
TriMesh delaunay_remesh(const TriMesh& mesh, const DelaunayRemeshOptions& options,
                        const Progress& progress = {});

}  // namespace vdbgeo
