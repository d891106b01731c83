// Better angles in a tetrahedral mesh: vertex moves and flips, in parallel and always the same.
#pragma once

#include <functional>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo {

/// The point of the surface nearest, or nearly so, to a place beside it; nothing where it finds none. Called
/// from several threads.
using SurfaceProjection = std::function<std::optional<Vec3d>(const Vec3d&)>;

struct TetOptimizeOptions {
    double min_dihedral_deg = 20, max_dihedral_deg = 130;  ///< tetrahedra outside are worked on
    int rounds = 20;  ///< at most; it ends where all angles are within, or nothing improves
    bool flips = true;
    /// Where set, boundary vertices move along the surface too; else they stay.
    SurfaceProjection onto_surface;

    void check() const;
};

struct TetOptimizeReport {
    int rounds = 0;
    std::uint64_t moves = 0, flips = 0;
    std::uint64_t outside_before = 0, outside_after = 0;  ///< tetrahedra with an angle out of the bounds
};

/// Raises the smallest and lowers the largest dihedral angles (Freitag & Ollivier-Gooch 1997,
/// doi:10.1002/(SICI)1097-0207(19971115)40:21<3979::AID-NME251>3.0.CO;2-9; Klingner & Shewchuk 2008,
/// doi:10.1007/978-3-540-75103-8_1): a vertex with bad tetrahedra around it moves to where the worst of them
/// is best; faces and edges are flipped (2-3, 3-2, 4-4, edge removal) where that raises the worst. No step
/// lowers the worst quality among the tetrahedra it touches, so none is ever turned over, and neither the
/// regions nor (but for `onto_surface`) the boundary change. A mesh within the bounds, and 0 rounds, give the
/// input back.
///
/// Vertices of one colour, and flips that share no tetrahedron, are done at once; the order is a function of
/// the mesh alone: the same bytes for any number of threads. Faces and tet properties are set anew
/// (properties are dropped). Cost: about 10 µs a tetrahedron of an isosurface stuffing on two threads. Throws
/// InvalidInput for a mesh that check() refuses or with tetrahedra turned over; Cancelled.
TetOptimizeReport optimize_tets(TetMesh& mesh, const TetOptimizeOptions& options = {},
                                const Progress& progress = {});

}  // namespace vdbgeo
