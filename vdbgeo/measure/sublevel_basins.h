// Basins of a function on the vertices of a mesh: where water that rises to a level stands.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The basins among some vertices (rising numbers), of which each has a value: connected through the edges of
/// faces, and parted at saddles. The vertices are taken in rising order of value (of equals the lower number
/// first), joined by union-find: one without a taken neighbour opens a basin; one where basins meet joins to
/// the deepest of them those whose depth there, its value less their least, is under `min_persistence`
/// (Edelsbrunner, Letscher, Zomorodian 2002, doi:10.1007/s00454-002-2885-2), and goes where its lowest
/// neighbour is. 0 parts the basins of all minima, infinity none that touch.
///
/// Returns the basin of each of `vertices`, numbered by their first vertices. Caps are no way from vertex to
/// vertex. Cost: O(n log n) for the vertices, O(f) for the faces; 4 bytes a vertex of the mesh and 60 a
/// vertex in the set. The same for any number of threads.
std::vector<std::uint32_t> sublevel_basins(const TriMesh& mesh, const std::vector<VertexId>& vertices,
                                           const std::vector<double>& values, double min_persistence);

}  // namespace vdbgeo
