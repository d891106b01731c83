// The inside of a closed surface by NetGen: advancing front, Delaunay, optimisation.
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct NetgenOptions {
    std::optional<double> max_edge_A;  ///< longest edge wanted; unset: no bound but grading
    double grading = 0.3;              ///< 0 (uniform)…1 (grows fast away from the surface)
    int optimisation_rounds = 3;       ///< 0…20
    std::uint64_t max_tets = 50'000'000;
    double max_seconds = 3600;
    std::uint64_t max_bytes = 0;  ///< of memory; 0: no limit

    void check() const;
};

/// Whether this build has NetGen (nglib).
bool have_netgen();

/// Fills the solids that `surface` bounds (see solid_input.h) by NetGen (Schöberl 1997,
/// doi:10.1007/s007910050004). The surface's points and faces are in the mesh, points first and in their
/// order, then those within each solid. Each solid is filled by a process of its own (isolated.h), as many at
/// once as there are threads; limits of time and memory are those of one. max_tets is looked at when a solid
/// is filled.
///
/// Angles are better than TetGen's, at ten times the time. But on a surface of regular quads, each parted in
/// two nearly coplanar triangles (a grid on a torus), it leaves some flat tetrahedra.
///
/// The same bytes in each run, for any number of threads. Cost: some 0.15 ms a tetrahedron. Throws as
/// tetgen_tetrahedra does; of several solids that fail the first is told.
TetMesh netgen_tetrahedra(const TriMesh& surface, const NetgenOptions& options = {},
                          const Progress& progress = {});

}  // namespace vdbgeo
