// Who is joined to whom, and who must stay: for smoothing, and for patches around a vertex.
#pragma once

#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The neighbours of each vertex, ascending: those of v are neighbours[begin[v]] … neighbours[begin[v + 1] −
/// 1]. The sides of a face that names a vertex twice are no edges. 24 bytes a face, twice that while it is
/// made; the same for any number of threads.
struct VertexNeighbours {
    Array<std::uint64_t> begin;
    Array<VertexId> neighbours;
    Array<char> fixed;  ///< on an edge that has not two faces (a border), or between a cap and what is none

    explicit VertexNeighbours(const TriMesh& mesh);
};

}  // namespace vdbgeo
