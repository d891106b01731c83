// Which triangles of a mesh cut each other (CGAL's exact predicates).
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Whether this build has CGAL.
bool have_self_intersections();

/// Pairs of faces (lower number first, sorted) that meet elsewhere than in a shared vertex or edge.
std::vector<std::pair<std::uint32_t, std::uint32_t>> self_intersections(const TriMesh& mesh,
                                                                        const Progress& progress = {});

}  // namespace vdbgeo
