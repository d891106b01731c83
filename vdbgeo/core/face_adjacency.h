// Which half-edges of an indexed mesh lie against each other.
#pragma once

#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Half-edge 3 f + k runs along face f from its corner k to its corner k + 1, the face to its left.
struct FaceAdjacency {
    static constexpr std::uint32_t none = 0xFFFFFFFFu;

    Array<std::uint32_t>
        twin;  ///< of each half-edge: the one that runs back along the same edge; none at a border
    Array<std::uint32_t>
        outgoing;  ///< one half-edge from each vertex, the border's where there is one; none: unused

    static std::uint32_t next(std::uint32_t h) { return h % 3 == 2 ? h - 2 : h + 1; }
    static std::uint32_t previous(std::uint32_t h) { return h % 3 == 0 ? h + 2 : h - 1; }
    /// The half-edge from the same vertex, one face on counter-clockwise; none past a border.
    std::uint32_t around(std::uint32_t h) const { return twin[previous(h)]; }
};

/// Pairs the half-edges of a mesh with good indices (see check()). Throws InvalidInput, as "STAGE needs a
/// manifold mesh: …", where an edge has three faces or two that run through it in the same direction, where
/// the faces of a vertex are not one fan, and where a face names a vertex twice. Cost: O(n), 20 bytes a face
/// and as much for a moment.
FaceAdjacency face_adjacency(const TriMesh& mesh, const char* stage);

}  // namespace vdbgeo
