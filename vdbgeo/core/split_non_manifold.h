// Makes a mesh a manifold by giving every sheet vertices of its own.
#pragma once

#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Splits vertices until each has one fan of faces and each edge at most two: where more faces meet at an edge they
/// are paired by their angles around it, so that sheets touch there without crossing. Geometry stays. Returns how many
/// vertices were added.
std::uint64_t split_non_manifold(TriMesh& mesh);

}  // namespace vdbgeo
