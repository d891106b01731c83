// Tetrahedra straight from a map with bounded dihedral angles: isosurface stuffing.
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct StuffingOptions {
    /// Side of the cubes at the surface, in voxels (the smallest voxel step); above 0. At 0.75 the volume of
    /// maps with walls of two or three voxels is within 1 % of that of marching_cubes; smooth bodies
    /// allow 1.5 or 2.
    double cell = 0.75;
    /// How many times cubes may double their side away from the surface, 0 (all alike)…8.
    int coarsening = 3;
    std::uint64_t max_tets = 500'000'000;

    /// Throws InvalidInput for a value out of range.
    void check() const;
};

/// Isosurface stuffing (Labelle & Shewchuk 2007, doi:10.1145/1276377.1276448) of where the trilinear
/// interpolant of the map is at or above `isovalue` (as marching_cubes and TrilinearField take it; outside
/// the map's box nothing is, so the body is closed there; where an unbounded grid's background is inside, the
/// body is the rest). Points in Å.
///
/// The background mesh is a body-centred cubic lattice in the world, cubic cells whatever the frame, its
/// origin at the map's first sample; away from the surface it is graded by a balanced octree. Lattice points
/// at most 0.27 of a long or 0.4 of a short lattice edge from the surface are snapped to it, and the
/// tetrahedra that it still crosses are cut by stencils. Boundary vertices are roots of the interpolant along
/// lattice edges. The boundary does not depend on the coarsening.
///
/// Dihedral angles are within 10.78° and 164.74°, the bounds of the paper; every tetrahedron is checked for
/// it before the mesh is given back. Two things are chosen otherwise than in the paper (no two snapped points
/// come towards each other, stuffing_snap.h; diagonals follow the cut points on long edges,
/// stuffing_stencils.h), with which a search for the worst case finds no angle outside 11.7°…162.6°.
///
/// The mesh is conforming, and its boundary is closed and oriented. It may touch itself, at vertices or along
/// edges, where the lattice does not resolve the surface: in walls and gaps of about a cell (noise is full of
/// them). Parts thinner than a cell may be lost or joined. Tetrahedra are all of region 1, faces are set.
///
/// The same bytes for any number of threads. Cost: in proportion to the tetrahedra and the crossed voxels; a
/// CPU makes 12 million tetrahedra a second in a thick uniform body, 5 graded, 2 in thin walls, less than 1
/// in noise. Memory: that of the mesh and a few bytes a tetrahedron for a time. Throws InvalidInput for an
/// option out of range; NumericalError where nothing crosses the isovalue, where the cell is too large for
/// any lattice point to be inside, for a cell so small that the map is wider than 2^24 cells, and for more
/// than max_tets; Cancelled.
TetMesh isosurface_stuffing(const DensityMap& map, double isovalue, const StuffingOptions& options = {},
                            const Progress& progress = {});

}  // namespace vdbgeo
