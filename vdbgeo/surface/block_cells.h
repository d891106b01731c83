// What the signs of a block's samples tell: which edges and cells the level set crosses, which faces are
// ambiguous. All of a layer of 8 × 8 at a time, a bit each.
#pragma once

#include "vdbgeo/core/types.h"
#include "vdbgeo/surface/cell_kernels.h"
#include "vdbgeo/surface/crossing_blocks.h"

namespace vdbgeo {

/// The crossed edges that begin in one block, its cells, and where their vertices and triangles stand. Filled
/// by the thread that counts the block.
struct BlockCells {
    cell::EdgeBits edges;
    cell::BlockBits active;  ///< cells that the surface crosses
    std::uint16_t edge_vertices, extra_vertices;
    std::uint16_t cells;
    std::uint32_t triangles;
    std::uint32_t first_vertex;    ///< its number in the mesh
    std::uint32_t vertex_place;    ///< and its place among the vertices of this extraction
    std::uint64_t triangle_place;  ///< of the first triangle among those of this extraction
};

/// Fills `edges`, `active` and `edge_vertices`. `samples`: how many of the block's samples and of the next
/// layer lie in the box, along each axis (2…9).
void find_edges(const CornerSigns& signs, const Vec3i& samples, BlockCells& out);

/// The ambiguous faces of the active cells. Returns whether there are any.
bool find_ambiguous_faces(const CornerSigns& signs, const cell::BlockBits active, cell::FaceBits& out);

/// Clears the bits of the ambiguous faces whose inside corners are not joined.
void decide_faces(const CornerSigns& signs, const BlockSamples& samples, float isovalue,
                  cell::FaceBits& faces);

}  // namespace vdbgeo
