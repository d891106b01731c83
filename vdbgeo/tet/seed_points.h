// Points in the spaces that a closed surface parts, well away from it.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// A side of a face: 2 · face, and 1 more for the side that the normal points to.
using FaceSide = std::uint32_t;

struct SeedPoint {
    Vec3d point = Vec3d::Zero();  ///< its coordinates are floats
    double clearance = 0;         ///< distance to the nearest face
};

/// For each space, given by sides of faces that lie in it, some points of it, those with the largest
/// clearance first: the middles of the ways along +x from the middles of up to eight of its faces, with large
/// projections onto the yz plane, to the next faces of the mesh. None for a space where no ray meets another
/// face, or all middles lie on the surface. Rays start at floats: beside faces of a few units in the last
/// place points may lie in another space, which their winding numbers tell.
///
/// Cost: O(n + sides), and eight queries of the nearest face a space.
std::vector<std::vector<SeedPoint>> seed_points(const TriMesh& mesh,
                                                const std::vector<std::vector<FaceSide>>& spaces);

/// For each point how many more times the ray along +x leaves a solid than it enters one: 1 inside of a
/// solid, 0 outside of all. The coordinates are those of floats.
std::vector<int> winding_numbers(const TriMesh& mesh, const std::vector<Vec3d>& points);

}  // namespace vdbgeo
