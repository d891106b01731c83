// Looking inside a tetrahedral mesh: what is left when tetrahedra are taken away (the paper's Figs 15, 16).
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// What is taken away. Exactly one of `plane` and `peel` is set.
struct CutawayOptions {
    struct Plane {
        Vec3d point = Vec3d::Zero();   ///< Å
        Vec3d normal = Vec3d::UnitY();  ///< points to what goes; any length above 0
        /// Whole tetrahedra go whose centroid is beyond the plane (the view of Fig 15); else those that the
        /// plane goes through are cut, and the cut is flat.
        bool whole_tets = true;
    };
    struct Peel {
        std::uint64_t count = 0;  ///< tetrahedra to take away; 0 gives the whole boundary
        /// The face to begin at, by its number in `faces`; unset: the one nearest to `from`.
        std::optional<std::uint64_t> seed_face;
        Vec3d from = Vec3d::Zero();  ///< Å; looked at where seed_face is unset
    };
    std::optional<Plane> plane;
    std::optional<Peel> peel;

    void check() const;
};

/// The boundary of what is left, as triangles with normals outward; every face has its own three vertices
/// where vertex colours would blend otherwise: vertices are shared among the old boundary's faces only.
///
/// Face properties: `interior` (1 on faces that were cut open), `region`, and min_dihedral_deg, radius_edge,
/// volume_A3 of the tetrahedron behind. Vertex properties of the same names hold the same numbers for the
/// faces that were cut open, so that a picture can be coloured by them, and on the old boundary NaN.
///
/// A peel goes breadth first from the tetrahedron behind the seed face, through faces, neighbours by their
/// number (§3.4, Fig 16); it stops early where a component ends. Throws InvalidInput for options out of range,
/// a mesh without tetrahedra and a seed face that is not on the boundary; NumericalError where nothing is
/// left. Cost: that of tet_adjacency.
TriMesh cutaway(const TetMesh& mesh, const CutawayOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
