// Mends what can be mended in a mesh.
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct RepairOptions {
    bool fill_holes = true;
    std::uint64_t max_hole_edges = 1000;  ///< larger holes stay open
    bool self_intersections = true;       ///< tries to remove them, where this build can find them (CGAL)

    /// Throws InvalidInput where holes are to be filled and max_hole_edges is under 3.
    void check() const;
};

struct RepairReport {
    std::uint64_t merged_vertices = 0;   ///< at open edges that coincide
    std::uint64_t degenerate_faces = 0;  ///< taken out
    std::uint64_t duplicate_faces = 0;   ///< taken out
    std::uint64_t flipped_faces = 0;     ///< to agree with their neighbours, or with their whole piece
    std::uint64_t flipped_pieces = 0;    ///< closed pieces that faced inward and are no cavities
    std::uint64_t split_vertices = 0;    ///< added to take sheets apart
    std::uint64_t filled_holes = 0, open_holes = 0;
    std::uint64_t added_faces = 0;      ///< in holes, those made to remove intersections too
    std::uint64_t unused_vertices = 0;  ///< taken out
    /// Faces that cut another; unset where nobody looked.
    std::optional<std::uint64_t> intersecting_faces_before, intersecting_faces_after;
    std::uint64_t moved_vertices = 0;  ///< to remove intersections
    std::uint64_t refilled_faces = 0;  ///< taken out around intersections and filled anew
};

struct RepairResult {
    TriMesh mesh;
    RepairReport report;
};

/// Mends a mesh, in this order:
/// 1. open edges that coincide bit by bit at both ends become one (a soup of triangles becomes a surface;
/// nothing else
///    is merged);
/// 2. faces that name a vertex twice go; of duplicate faces the first stays, and opposite ones cancel unless
/// that would
///    open a hole;
/// 3. in each patch faces are turned to agree with the majority;
/// 4. sheets that touch get vertices of their own (split_non_manifold);
/// 5. holes of at most max_hole_edges are filled (see fill_holes: large fillings are plain, folded ones are
/// refused);
/// 6. closed pieces that face inward are turned, unless they are cavities;
/// 7. faces that cut other faces of their own piece, or that touch since step 5, are smoothed, and where that
/// does not
///    help taken out with their neighbours and filled anew, as long as fewer faces cut each other for it (see
///    untangle). Pieces that cross each other are reported, not mended;
/// 8. unused vertices go.
///
/// The result is an oriented manifold; it is closed where open_holes is 0. Whatever is right is not touched:
/// a good mesh comes back with the same bytes. Properties are kept; new faces have 0.
///
/// Throws InvalidInput for a mesh that check() refuses, and for a surface with one side only. Cost: O(n) and
/// some sorts; finding intersections costs most.
RepairResult repair(const TriMesh& mesh, const RepairOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
