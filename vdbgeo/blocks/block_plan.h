// Into which blocks a map is cut that does not fit into memory, and how many steps are taken in one.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <vector>

#include "vdbgeo/blocks/brick_index.h"

namespace vdbgeo {

/// What blocks are made for.
struct BlockWork {
    int steps = 0;  ///< of a cycle; 0: the map is only read
    int steps_a_sweep = 1;
    int reach = 1;        ///< voxels that a step looks around
    int first_reach = 0;  ///< and the coefficients before the first one
    int last_reach = 0;   ///< and what is found after the last one
    double bytes_a_brick = 0;
    double bytes_of_window = 0;  ///< for each brick of two slabs of 32 voxels along y, on top
};

struct BlockPlan {
    openvdb::Coord size;  ///< voxels of a block without its ghosts, at multiples of a cell's
    int steps = 0;        ///< taken in a block before its values are put down
    int halo = 0;         ///< ghosts around a block, a multiple of 8
    std::vector<openvdb::CoordBBox> blocks;  ///< those that have leaves, by y, z, x
};

/// The cells that a box of voxels touches.
openvdb::CoordBBox cells_of(const openvdb::CoordBBox& box);

/// Ghosts around a block, in voxels and whole leaves, for some steps of a cycle.
int block_halo(const BlockWork& work, int steps, bool first, bool last);

/// Blocks of `size` voxels (at multiples of a cell's) that cover a box of voxels, those of lower y, then z,
/// then x, first. `index`: only blocks that hold leaves.
std::vector<openvdb::CoordBBox> blocks_of(const openvdb::CoordBBox& box, const openvdb::Coord& size,
                                          const BrickIndex* index = nullptr);

/// The cheapest way to take a cycle through a map in blocks of at most so many bytes: ghosts are computed
/// twice, and fewer steps in a block mean that more is written and read. With `index` the leaves that there
/// are count, else all that the box could hold. NumericalError where not even the smallest blocks fit.
BlockPlan plan_blocks(const openvdb::CoordBBox& box, const BlockWork& work, std::uint64_t bytes,
                      const BrickIndex* index = nullptr);

}  // namespace vdbgeo
