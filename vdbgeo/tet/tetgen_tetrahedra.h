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
    double radius_edge = 1.414;     ///< largest circumradius over shortest edge; 1 or more (TetGen -q)
    double min_dihedral_deg = 10;   ///< smallest dihedral angle asked for, 0…18; 0: none (-q/)
    std::optional<double> max_volume_A3;  ///< of a tetrahedron (-a)
    SizeField size;                 ///< edge lengths (-m); empty: by the surface's own triangles
    bool keep_surface = true;       ///< no new points on the surface (-Y)
    std::uint64_t max_tets = 50'000'000;
    double max_seconds = 3600;
    std::uint64_t max_bytes = 0;  ///< of memory; 0: no limit

    void check() const;
};

/// Whether this build has TetGen.
bool have_tetgen();

/// Fills the solids that `surface` bounds (see solid_input.h: which surfaces, regions and cavities) by TetGen's
/// constrained Delaunay refinement (Si 2015, doi:10.1145/2629697). With keep_surface the points and faces of
/// the surface are in the mesh bit for bit, the points first and in their order; quality bounds hold then away
/// from the surface's own sharp or thin triangles. TetGen runs in a process of its own (isolated.h).
///
/// The same bytes in each run. Cost: some 8 µs and 0.9 KB a tetrahedron. Throws InvalidInput for a bad
/// surface, an option out of range, and where this build has no TetGen; NumericalError where TetGen gives up,
/// crashes, or a cap is reached; Cancelled.
TetMesh tetgen_tetrahedra(const TriMesh& surface, const TetgenOptions& options = {},
                          const Progress& progress = {});

}  // namespace vdbgeo
