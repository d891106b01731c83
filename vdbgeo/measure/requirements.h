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

/// Throws InvalidInput "STAGE needs a closed mesh: 12 boundary edges; …repair…" unless the mesh has it all.
void require(const MeshMeasures& measures, const MeshRequirements& needed, const std::string& stage);

}  // namespace vdbgeo
