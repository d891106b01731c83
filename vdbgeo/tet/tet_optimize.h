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
    /// Tetrahedra with an angle outside are worked on; 1…70 and 71…179.
    double min_dihedral_deg = 20, max_dihedral_deg = 130;
    int rounds = 20;  ///< at most; it ends where all angles are within, or nothing improves
    bool flips = true;
    /// Where set, boundary vertices move along the surface too; else they stay. See map_projection.h.
    SurfaceProjection onto_surface;

    void check() const;
};

struct TetOptimizeReport {
    int rounds = 0;
    std::uint64_t moves = 0, flips = 0;  ///< of vertices, or of all corners of a tetrahedron at once
    std::uint64_t outside_before = 0, outside_after = 0;  ///< tetrahedra with an angle out of the bounds
};

/// Raises the smallest and lowers the largest dihedral angles of the tetrahedra that have one outside the
/// bounds (Freitag & Ollivier-Gooch 1997,
/// doi:10.1002/(SICI)1097-0207(19971115)40:21<3979::AID-NME251>3.0.CO;2-9; Klingner & Shewchuk 2008,
/// doi:10.1007/978-3-540-75103-8_1). What an angle θ is worth is
///
///   min( sin(θ/2) / sin(min/2), cos(θ/2) / cos(max/2) ),
///
/// 1 on either bound. A vertex with bad tetrahedra around it moves to where the worst angle around it is
/// best; faces and edges are flipped (2-3, 3-2, 4-4, removal of edges with up to 7 tetrahedra) where that
/// raises the worst; where all that is stuck the corners of a bad tetrahedron move together.
///
/// No step lowers what the worst of the tetrahedra it touches is worth, so none is ever turned over. No
/// vertex comes or goes, and the regions, their faces and (but for `onto_surface`) the boundary stay to the
/// last bit. With `onto_surface` boundary vertices of one region slide; a boundary triangle turns by at most
/// 60° in a step and folds onto its neighbour by no more than 60° to it. Parts of the surface that are apart
/// are not kept from each other. No tetrahedron becomes longer (circumradius over shortest edge) than 2.5 or
/// the longest around. A mesh within the bounds, and 0 rounds, give the input back. There is no promise that
/// the bounds are met: a sharp corner of a fixed boundary may have no room for them.
///
/// Vertices of one colour, and flips that share no tetrahedron, are done at once; the order is a function of
/// the mesh alone: the same bytes for any number of threads. `faces` are set anew, tet properties dropped,
/// vertex properties left as they are. On an error or when cancelled the mesh is as it was.
///
/// Cost: the finding of what is bad and of neighbours, 0.5 µs a tetrahedron; some 50 µs a bad one. Throws
/// InvalidInput for a mesh that check() or tet_adjacency refuses or with tetrahedra turned over (flat ones
/// are let through); Cancelled.
TetOptimizeReport optimize_tets(TetMesh& mesh, const TetOptimizeOptions& options = {},
                                const Progress& progress = {});

}  // namespace vdbgeo
