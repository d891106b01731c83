// Closes the holes of a mesh.
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct FilledHoles {
    std::uint64_t filled = 0, left_open = 0, faces = 0, vertices = 0;
};

/// Triangulates the boundary loops of at most `max_edges` edges. The triangulation is the one whose largest
/// angle between neighbouring faces, those around the hole included, is least, and of those the one of least
/// area (Liepa 2003, doi:10.2312/SGP/SGP03/200-206), without his refinement: it has no inner vertices, and
/// suits holes that are small against the shape. Loops of more than 128 edges first lose their shortest ears.
/// Where every triangulation would use an edge that the mesh has elsewhere, the loop is joined to a new
/// vertex at its mean.
///
/// A loop stays open where its filling would fold back onto the faces around it (by more than 172°): the
/// outline of a flat sheet is no hole. New faces come after the old ones and have face properties 0; a new
/// vertex has the mean of the loop's.
///
/// Where holes touch in a vertex each is a loop of its own. Open edges that form no loop (in a mesh that is
/// not an oriented manifold) are left, and not counted. Cost: O(n³) for a loop of n edges up to 128, O(n²)
/// beyond.
FilledHoles fill_holes(TriMesh& mesh, std::uint64_t max_edges, const Progress& progress = {});

}  // namespace vdbgeo
