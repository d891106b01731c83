// Makes a mesh a manifold by giving every sheet vertices of its own.
#pragma once

#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Splits vertices until each has one fan of faces and each edge at most two faces.
///
/// Where more than two faces meet at an edge they are paired by their angles around it: going round the edge,
/// a face behind which the solid begins is paired with the next one where it ends (as brackets are), so that
/// sheets touch there without crossing and solids that touch come apart. A face without a partner (the third
/// of three) gets a border there. Two faces are always a pair, however they are turned. Then each fan of
/// faces around a vertex, joined through paired edges, gets a vertex of its own; the fan of the lowest face
/// keeps the old one.
///
/// Where two sheets touch along an edge but are one fan at both of its ends, no vertex can be split: there
/// each sheet but one gets a vertex of its own in the middle of the edge, and its faces are cut in two there.
///
/// Geometry stays: no point moves, and new vertices lie on old ones or in the middle of edges. Properties are
/// copied (the mean of both ends in the middle of an edge). New vertices and faces come after the old ones.
/// Degenerate faces are not looked at, and stay as they are. A manifold mesh is not touched.
///
/// Returns how many vertices were added. The mesh must be one that check() accepts. Cost: O(n), parallel, 16
/// bytes a face, for a manifold mesh; each singular vertex or edge adds a sort of its faces.
std::uint64_t split_non_manifold(TriMesh& mesh);

}  // namespace vdbgeo
