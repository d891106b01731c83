// Tetrahedra straight from a map with proven dihedral angles: isosurface stuffing.
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct StuffingOptions {
    double cell = 1.5;  ///< side of the cubes at the surface, in voxels (the smallest voxel step); above 0
    /// How many times cubes may double their side away from the surface, 0 (all alike)…8.
    int coarsening = 3;
    std::uint64_t max_tets = 500'000'000;

    void check() const;
};

/// Isosurface stuffing (Labelle & Shewchuk 2007, doi:10.1145/1276377.1276448) of where the trilinear
/// interpolant of the map is at or above `isovalue` (as marching_cubes and TrilinearField take it; outside
/// the map's box nothing is). The background mesh is a body-centred cubic lattice in the world, cubic cells
/// whatever the frame, graded by a balanced octree away from the surface; lattice points near the surface are
/// snapped to it, and the tetrahedra that it still crosses are cut by stencils. Boundary vertices lie on the
/// surface.
///
/// All dihedral angles are within 10.78° and 164.74° (α_long = 0.24999, α_short = 0.41189): checked on every
/// tetrahedron before the mesh is given back. The boundary is closed; it is a manifold wherever the lattice
/// resolves the surface. Parts thinner than a cell may be lost or joined.
///
/// The same bytes for any number of threads. Cost: in proportion to the tetrahedra, over 3 million a second
/// on two threads. Throws InvalidInput for an option out of range; NumericalError where nothing crosses the
/// isovalue and for more than max_tets; Cancelled.
TetMesh isosurface_stuffing(const DensityMap& map, double isovalue, const StuffingOptions& options = {},
                            const Progress& progress = {});

}  // namespace vdbgeo
