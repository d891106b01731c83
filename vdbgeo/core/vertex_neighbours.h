// Who is joined to whom, and who must stay: for smoothing.
#pragma once

#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The neighbours of each vertex, ascending: those of v are neighbours[begin[v]] … neighbours[begin[v + 1] −
/// 1].
struct VertexNeighbours {
    Array<std::uint64_t> begin;
    Array<VertexId> neighbours;
    Array<char> fixed;  ///< on an edge that has not two faces (a border), or between a cap and what is none

    explicit VertexNeighbours(const TriMesh& mesh);
};

}  // namespace vdbgeo
