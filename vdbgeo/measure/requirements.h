// What a stage needs of a mesh, refused by name where it is missing.
#pragma once

#include <string>

#include "vdbgeo/measure/mesh_measures.h"

namespace vdbgeo {

struct MeshRequirements {
    bool closed = false;
    bool oriented = false;
    bool manifold = false;
    bool not_empty = true;
};

/// Throws InvalidInput unless the mesh has all that is needed. The message names the stage, each thing that
/// is missing with its counts, and what to try: "STAGE needs a closed mesh: the surface is open: 12 boundary
/// edges in 2 holes; try repair or --cap".
void require(const MeshMeasures& measures, const MeshRequirements& needed, const std::string& stage);

}  // namespace vdbgeo
