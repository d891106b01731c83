// Local operators: out = f(window of in), tile by tile on dense arrays.
#pragma once

#include <functional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"
#include "vdbgeo/stencil/plane_kernels.h"

namespace vdbgeo::stencil {

/// A cell with its halo as dense arrays: voxel (x, y, z), counted from the cell's origin and from −halo on,
/// at at(x, y, z) of each array; rows along z, `stride_y` floats apart, planes `stride_x` apart, one array
/// behind the other. Arrays have a guard of zeros before and behind.
struct Tile {
    std::size_t cell;       ///< its number in the layout
    openvdb::Coord origin;  ///< index of the cell's first voxel
    int halo;
    int lead;  ///< rows begin in memory, on a cache line, at z = −lead ≤ −halo
    std::ptrdiff_t stride_x, stride_y;
    std::vector<float*> in;       ///< the gathered fields; 0 in voxels that are not active
    float* active;                ///< 1 in active voxels, 0 in the others
    std::vector<float*> scratch;  ///< arrays of the same shape, to work in; not cleared from tile to tile
    std::vector<float*> out;      ///< what is copied back of the cell's active leaves; 0 before
    /// Voxels of the cell, counted from its origin, that the layout works on: there, and as far as the halo
    /// reaches around it, is what was gathered.
    openvdb::CoordBBox work;

    std::ptrdiff_t at(int x, int y, int z) const { return x * stride_x + y * stride_y + z; }
    /// Active part of the row, z counted as above; empty where begin ≥ end.
    RowSpan span(int x, int y) const { return spans[static_cast<std::size_t>((x + halo) * rows + y + halo)]; }
    int rows;
    const RowSpan* spans;
};

struct TileFields {
    std::vector<const float*> in;  ///< bricks
    std::vector<float*> out;       ///< bricks; another memory than `in`
    int halo = 1;                  ///< 0…BlockLayout::max_halo
    int scratch = 0;               ///< how many arrays to work in
    /// Only about one cell of so many, chosen by where they lie: a sample, where nothing is written.
    std::size_t every = 1;
};

/// Whether the cell that begins there is one of those that stand for `every` of them: neighbours along each
/// axis fall to different ones.
bool in_sample(const openvdb::Coord& cell, std::size_t every);

/// Runs body(tile) for every own cell, in parallel; each thread has its own arrays. (32+2h)² (128+2h') floats
/// an array. Only active voxels of the cell may be written with something else than 0 in `out`.
void for_each_tile(const BlockLayout& layout, const TileFields& fields,
                   const std::function<void(Tile&)>& body, const Progress& progress = {});

}  // namespace vdbgeo::stencil
