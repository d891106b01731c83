// The inside of a closed surface by constrained Delaunay tetrahedralization (TetGen).
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/tet/size_field.h"

namespace vdbgeo {

struct TetgenOptions {
    double radius_edge = 1.414;           ///< largest circumradius over shortest edge; 1 or more (TetGen -q)
    double min_dihedral_deg = 10;         ///< smallest dihedral angle asked for, 0…18; 0: none (-q/)
    std::optional<double> max_volume_A3;  ///< of a tetrahedron (-a)
    /// Edge lengths: tetrahedra of more than 0.2 · size³ (at their centroids) are refined, which leaves edges
    /// of that length on average. Empty: by the surface's own triangles.
    SizeField size;
    /// No new points on the surface (-Y). Else TetGen parts its triangles so that the bounds hold on them
    /// too; on the triangles of a curved surface, whose edges meet at acute angles, that makes some five
    /// times as many tetrahedra, of no better angles.
    bool keep_surface = true;
    std::uint64_t max_tets = 50'000'000;
    double max_seconds = 3600;
    std::uint64_t max_bytes = 0;  ///< of memory; 0: no limit

    void check() const;
};

/// Whether this build has TetGen.
bool have_tetgen();

/// Fills the solids that `surface` bounds (see solid_input.h: which surfaces, regions and cavities) by
/// TetGen's constrained Delaunay refinement (Si 2015, doi:10.1145/2629697). With keep_surface the points and
/// faces of the surface are in the mesh bit for bit, the points first and in their order (as solid_input has
/// them: those of the same coordinates once, unused ones left out); quality and size bounds hold then away
/// from the surface's own sharp, thin or large triangles. TetGen runs in a process of its own (isolated.h),
/// and what comes of it is checked (filled_mesh.h).
///
/// The same bytes in each run. Cost: some 10 µs and 0.9 KB a tetrahedron. Throws InvalidInput for a bad
/// surface, an option out of range, a size that is not above 0, and where this build has no TetGen;
/// NumericalError where TetGen gives up, crashes, or a cap is reached; Cancelled.
TetMesh tetgen_tetrahedra(const TriMesh& surface, const TetgenOptions& options = {},
                          const Progress& progress = {});

}  // namespace vdbgeo
