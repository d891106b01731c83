// Points in the spaces that a closed surface parts, well away from it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// A side of a face: 2 · face, and 1 more for the side that the normal points to.
using FaceSide = std::uint32_t;

struct SeedPoint {
    Vec3d point = Vec3d::Zero();  ///< its coordinates are floats
    double clearance = 0;         ///< distance to the nearest face
};

/// For each space, given by sides of faces that lie in it, a point of it: the middle of the way along +x from
/// the middle of one of its faces to the next face of the mesh; of three such faces with large projections
/// onto the yz plane that with the largest clearance. Nothing for a space where no ray meets another face, or
/// the middle lies on the surface.
///
/// Cost: O(n + sides), and three queries of the nearest face a space.
std::vector<std::optional<SeedPoint>> seed_points(const TriMesh& mesh,
                                                  const std::vector<std::vector<FaceSide>>& spaces);

/// For each point how many more times the ray along +x leaves a solid than it enters one: 1 inside of a
/// solid, 0 outside of all. The coordinates are those of floats.
std::vector<int> winding_numbers(const TriMesh& mesh, const std::vector<Vec3d>& points);

}  // namespace vdbgeo
