// Edges of faces that are none of the shape.
#pragma once

namespace vdbgeo {

/// The face property whose bits 1, 2, 4 tell the edges (opposite to corner 0, 1, 2) that pictures do not
/// draw: diagonals of polygons that had to be cut into triangles.
inline constexpr const char* hidden_edges_property = "hidden_edges";

}  // namespace vdbgeo
