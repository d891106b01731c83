// Looking inside a tetrahedral mesh: what is left when tetrahedra are taken away (the paper's Figs 15, 16).
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The property that is 1 on faces that were cut open and 0 on the old boundary.
inline constexpr const char* interior_property = "interior";

/// What is taken away. Exactly one of `plane` and `peel` is set.
struct CutawayOptions {
    struct Plane {
        Vec3d point = Vec3d::Zero();    ///< Å
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

/// The boundary of what is left, as triangles with normals outward. Faces that were cut open have three
/// vertices of their own, so that vertex colours do not blend; those of the old boundary share theirs among
/// each other. By its points the surface is closed: it encloses the volume of what is left.
///
/// Face properties: `interior` (1 on faces that were cut open, else 0), `region`, and min_dihedral_deg,
/// radius_edge, volume_A3 of the whole tetrahedron behind (tet_quality.h). Vertex properties of the same
/// names hold the same numbers for the faces that were cut open, so that pictures can be coloured by them; on
/// the old boundary they are NaN (`interior`: 0).
///
/// A flat cut keeps what has n·(p − point) < 0. Points nearer to the plane than 1e-12 of the mesh's extent
/// count as on it, so that a plane through lattice points cuts no splinters. A tetrahedron gives a triangle,
/// or two by the shorter diagonal; points on an edge are the same bits for all tetrahedra around it.
///
/// A peel goes breadth first from the tetrahedron behind the seed face, through faces, neighbours by their
/// number (§3.4, Fig 16); it stops early where a component ends. It needs the mesh's `faces`.
///
/// Throws InvalidInput for options out of range, a damaged mesh or one without tetrahedra, and a seed face
/// that is not on the boundary; NumericalError where nothing is left. Cost: that of tet_adjacency.
TriMesh cutaway(const TetMesh& mesh, const CutawayOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
