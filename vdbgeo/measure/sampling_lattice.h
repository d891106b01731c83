// The grid that a mesh was cut from, where its vertices still tell.
#pragma once

#include <optional>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Where a vertex lies on the lattice: on an edge between two nodes, or on a node.
struct LatticePlace {
    int axis = -1;     ///< of the edge; −1 on a node
    double along = 0;  ///< t(1 − t) steps², Å², t the fraction of the edge: 0 at its ends
};

/// Nodes at origin + step·(i, j, k), the axes those of the coordinates.
struct SamplingLattice {
    Vec3d origin, step;  ///< Å

    LatticePlace place(const Vec3f& point) const;
};

/// The lattice on whose edges at least 95 % of the vertices lie, to 1/500 of a step: two coordinates of each
/// are those of nodes, as marching cubes leaves them. None where there is no such lattice: turned, smoothed
/// and remeshed surfaces. Steps may differ between axes. Looks at every vertex once and at some thousands of
/// them closely.
std::optional<SamplingLattice> find_sampling_lattice(const TriMesh& mesh);

}  // namespace vdbgeo
