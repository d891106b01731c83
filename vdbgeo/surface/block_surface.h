// The surface in one crossed block: which patterns its cells have, its vertices and triangles.
#pragma once

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/surface/block_cells.h"
#include "vdbgeo/surface/cell_kernels.h"
#include "vdbgeo/surface/cell_topology.h"
#include "vdbgeo/surface/crossing_blocks.h"

namespace vdbgeo {

class DrawingTable;

/// Counts and draws the surface, block by block; each thread may do others. Refers to the blocks.
class BlockSurface {
 public:
    BlockSurface(const CrossingBlocks& blocks, const Frame& frame, float isovalue);

    /// Fills `out` but for where its vertices and triangles stand, writes the patterns of the block's active
    /// cells and returns the end of them.
    cell::PatternId* count(std::size_t b, BlockSamples& samples, BlockCells& out,
                           cell::PatternId* patterns) const;

    /// What a block is filled with, and where to.
    struct Filling {
        std::size_t block = 0;
        BlockSamples samples;         // of the block
        cell::VertexNumbers numbers;  // around its cells
        Vec3f* points = nullptr;      // the block's first
        const float* end_of_points = nullptr;
        Triangle* triangles = nullptr;
        std::uint32_t* end_of_triangles = nullptr;
        Vec3f* extra_point = nullptr;    // the next vertex inside a cell
        std::uint32_t extra_number = 0;  // and its number
    };
    void load(Filling& filling) const { blocks_.load(filling.block, filling.samples); }
    void take_numbers(const cell::EdgeBits& edges, std::uint32_t first_vertex, int side,
                      Filling& filling) const {
        kernels_.take_numbers(edges, first_vertex, side, filling.numbers);
    }
    /// The vertices on the block's edges, of which there are some.
    void place_vertices(Filling& filling, const BlockCells& cells) const;
    /// Its triangles, of which there are some, and the vertices inside its cells. The numbers around have to
    /// be taken.
    void make_triangles(Filling& filling, const BlockCells& cells, const cell::PatternId* patterns) const;

 private:
    Vec3i samples_in_box(std::size_t b) const;
    void settle(const cell::OpenCell* open, int count, const BlockSamples& samples,
                cell::PatternId* patterns) const;
    Vec3f world(const openvdb::Coord& origin, const Vec3d& place) const;
    double crossing(float a, float b) const;
    Vec3d crossing_on(const BlockSamples& s, int x, int y, int z, int e) const;
    void draw_special(Filling& filling, int x, int y, int z, int pattern, VertexId* numbers,
                      VertexId* out) const;

    const CrossingBlocks& blocks_;
    const Frame frame_;
    const bool mirrored_;  // the frame turns triangles round
    const bool diagonal_;  // the frame's axes are the world's
    const double isovalue_;
    const DrawingTable& table_;
    const cell::Kernels& kernels_ = cell::kernels();
};

}  // namespace vdbgeo
