// How deep places of a surface lie under what closes its pockets.
#pragma once

#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The distance, Å, of each of some vertices (rising numbers) from the convex hull of its piece, from within;
/// a cavity counts to the shell around it (shells_of_cavities). 0 in pieces that lie in a plane. Exact up to
/// rounding. Throws InvalidInput where this build has no CGAL. Cost: O(n) for the pieces, a hull for each
/// with such a vertex, a microsecond or so a vertex.
std::vector<double> hull_depths(const TriMesh& mesh, const std::vector<VertexId>& vertices,
                                const Progress& progress = {});

/// Spacing over ball's radius of the places where ambient_depths puts the ball.
constexpr double ambient_spacing = 0.125;

/// The distance, Å, of each of some vertices from the nearest place that a ball of this radius reaches as it
/// rolls on the mesh from outside: where C are the centres at least `radius` from all faces that can be got
/// at from afar without coming nearer, the depth is dist(v, C) − radius, and 0 where the ball touches.
/// Cavities are deep under the surface, and so is all behind an entrance that the ball does not pass. All
/// pieces of the mesh are in its way, caps too; it rolls through borders wider than itself.
///
/// C is known at its boundary points nearest to a cubic grid of ambient_spacing · radius, each exact up to
/// rounding: depths come out too large by spacing²/(2 radius) or so, under 1 % of the radius, where the ball
/// lies on a face, and by up to half the spacing where it is stuck between several.
///
/// Throws InvalidInput for a radius that is not positive or so small beside the mesh that the grid would have
/// more than 2^33 places (about a 250th of its length). Cost: some µs for each grid place within a block of
/// 4³ of the boundary of C, 1 bit for each place within 8³ of it, and a query of a TriangleTree a vertex.
std::vector<double> ambient_depths(const TriMesh& mesh, const std::vector<VertexId>& vertices, double radius,
                                   const Progress& progress = {});

}  // namespace vdbgeo
