// Which blocks of the lattice hold the inside of a surface. For isosurface_stuffing; nothing outside this
// folder needs it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/tet/stuffing_lattice.h"

namespace vdbgeo::stuffing {

/// A block and the bricks of 2³ slots in it which may hold an end of a crossed edge: bit 16·x + 4·y + z.
struct MarkedBlock {
    std::uint64_t key = 0, bricks = 0;
};

/// The marked blocks by key: every end of every edge of the lattice that the surface crosses lies in a brick
/// that is marked. So the points of a brick that is not, and of all blocks that are not, are on one side.
///
/// Found from the voxels: the surface runs in cells with samples on both sides and through the border of the
/// box, and the ends of an edge lie within one cell of the lattice of the crossing. Cost: in proportion to
/// the crossed voxels.
std::vector<MarkedBlock> mark_blocks(const DensityMap& map, double isovalue, const Lattice& lattice,
                                     std::uint64_t max_blocks, const Progress& progress);

struct Block {
    Coord at;
    std::int32_t marked = -1;  ///< its place in the list of marked blocks; -1: wholly inside
    /// The 27 blocks around, x slowest; -1: wholly outside.
    std::array<std::int32_t, 27> around{};
};
/// Which of Block::around holds the slot (x, y, z), each −8…15.
inline std::size_t side_of(int x, int y, int z) {
    return static_cast<std::size_t>(((x >> 3) + 1) * 9 + ((y >> 3) + 1) * 3 + (z >> 3) + 1);
}

/// The blocks with something inside, by key, and those that are marked.
class BlockTable {
 public:
    BlockTable(const std::vector<MarkedBlock>& marked, const Lattice& lattice, std::uint64_t max_blocks);

    std::size_t size() const { return blocks_.size(); }
    const Block& operator[](std::size_t b) const { return blocks_[b]; }
    std::int32_t find(const Coord& at) const;
    /// The block of the slot (x, y, z) of block b, each −8…15.
    std::int32_t near(std::size_t b, int x, int y, int z) const {
        return blocks_[b].around[side_of(x, y, z)];
    }

 private:
    /// Consecutive keys: a node of the octree over blocks without a marked one, all inside; or one marked
    /// block.
    struct Run {
        std::uint64_t key, count;
        std::int32_t marked;
    };
    void add_node(const std::vector<MarkedBlock>& marked, std::size_t begin, std::size_t end,
                  std::uint64_t key, int level, const Lattice& lattice);
    void fill(std::uint64_t max_blocks);

    std::vector<Run> runs_;
    std::vector<Block> blocks_;
    std::vector<std::uint64_t> keys_;
    std::vector<std::int32_t> slots_;  // open addressing; -1: free
};

}  // namespace vdbgeo::stuffing
