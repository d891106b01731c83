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
    double angle_deg = 30;  ///< least angle of a triangle; up to 30, where the refinement is sure to end
    double radius = 0.8;    ///< largest radius of a triangle's surface Delaunay ball, in voxels
    double distance =
        0.8;  ///< largest distance from a triangle's circumcentre to its ball's centre, in voxels
    std::uint64_t max_vertices = 20'000'000;
    double max_seconds = 3600;

    void check() const;
};

/// Whether this build has CGAL.
bool have_delaunay();

/// The surface {u = isovalue} of a map's trilinear interpolant u, as marching_cubes takes it, by restricted
/// Delaunay refinement (Boissonnat & Oudot 2005, doi:10.1016/j.gmod.2005.01.004) on CGAL's Delaunay
/// triangulation. A voxel is the smallest of the three voxel steps; lengths are measured in the world, so
/// that skewed and anisotropic frames give well-shaped triangles too. Vertices lie on the surface, normals
/// point from dense to empty. Closed: outside the box of a bounded frame counts as empty, and there the
/// surface is the border of the box.
///
/// Refinement starts from seeds on all of the marching-cubes surface (about two thirds of the vertices of the
/// result), so that no component is missed; those of less than seven radii across are meshed finer, at 0.15
/// of their size. The result is compared with marching cubes, and refined where a component is missing,
/// joined or parted, or a vertex is farther than the radius from the result; there the bound follows the
/// thickness of necks and spikes down to 1/64 of the radius. Thinner ones may be cut: what hangs by such a
/// neck is a component of its own then, and the tip of such a spike is missing. Components still missing
/// then, and closed ones of up to eight radii across that are joined or parted, are copied from marching
/// cubes, whose angles are what they are. Triangles keep the angle bound down to balls of 1/16384 of the
/// radius; such small ones lose some of it when their coordinates are rounded to floats. Vertices where
/// sheets touch are split: the result is always closed and a manifold.
///
/// The same bytes in each run, for any number of threads (one is used). Cost: about 45 µs and 1.5 KB a
/// vertex. An isovalue that nothing crosses gives an empty mesh. Throws InvalidInput for an option out of
/// range and where this build has no CGAL; NumericalError where a cap is reached (naming it); Cancelled.
TriMesh delaunay_surface(const DensityMap& map, const DelaunaySurfaceOptions& options,
                         const Progress& progress = {});

}  // namespace vdbgeo
