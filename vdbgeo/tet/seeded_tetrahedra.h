// Delaunay tetrahedra of regions that are told apart by place, started from a mesh of their boundary so that
// nothing is missed. Shared by what delaunay_tetrahedra takes.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/tet/delaunay_tet_mesher.h"

namespace vdbgeo {

/// A mesh of the boundary of a domain, in the domain's unit: near it, not on it.
struct ReferenceBoundary {
    std::vector<Vec3d> points;
    Array<Triangle> triangles;
    /// The connected part of the boundary that a triangle belongs to. Small parts are seeded more densely.
    std::vector<std::uint32_t> part;
    /// How far the boundary may be from a triangle.
    double reach = 0;
};

/// Numbers the parts of a reference: triangles that share a vertex belong together.
std::vector<std::uint32_t> connected_parts(std::size_t points, const Array<Triangle>& triangles);

struct SeededTetOptions {
    TetMesherBounds bounds;
    TetMesherOptimization optimization;
    bool parallel = false;
};

/// The regions of a domain as tetrahedra. Refinement starts from seeds on the whole boundary, 1.2 facet sizes
/// apart and on parts of less than seven facet sizes across 0.17 of their size. A seed that has no
/// tetrahedron of each of its two regions afterwards tells of a part that the mesh misses, or a sheet thinner
/// than its seeds are apart: there the seeds are set twice as densely and refinement goes on, up to four
/// times, down to 1/16 of the distance. What is thinner still may be missing.
///
/// The result is in an order of its own that is good for the cache (along a Z curve), positively oriented,
/// its faces set. Throws InvalidInput and NumericalError as the mesher does, and NumericalError where there
/// is no boundary, or where a tetrahedron is flat to the last bit and no optimiser mends it; Cancelled.
TetMesh seeded_tetrahedra(const TetDomain& domain, const ReferenceBoundary& reference,
                          const SeededTetOptions& options, const Progress& progress);

}  // namespace vdbgeo
