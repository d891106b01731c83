// The wall of a tunnel inside one cell of marching cubes, triangulated by where its crossings lie.
#pragma once

#include "vdbgeo/core/types.h"
#include "vdbgeo/surface/cell_topology.h"

namespace vdbgeo::cell {

/// Writes the triangles of the pattern's tunnel and the places of its ring's vertices, `centres[k]` for the
/// extra vertex 12 + k. `crossings` of the edges of both loops; places in units of the cell.
///
/// The crossings of both loops are corners of their convex hull and the loops run along its edges, so seen
/// from a point inside they are disjoint simple curves. So are the wall's triangles, and no two cut each
/// other, if all face away from one point of the tunnel (or all towards it). The band between two loops is
/// the one whose most oblique triangle faces it best; the ring is tried at several places between them.
void make_tunnel(Pattern& pattern, const std::array<Vec3d, edges>& crossings,
                 std::array<Vec3d, max_centres>& centres);

}  // namespace vdbgeo::cell
