// How a map that is larger than memory is cut into blocks, which are gone through one after another.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstddef>

namespace vdbgeo {

/// What blocks have to be like.
struct BlockRules {
    openvdb::Coord step{8, 8, 128};  ///< their faces lie at multiples of this
    int below = 0, above = 8;        ///< voxels around a block that are read with it
    /// Axes along which they are cut, the last first, and the others only once blocks are thin along it: of a
    /// map file, the axes from the one that runs fastest on.
    std::array<int, 3> order{0, 1, 2};
};

/// A box of voxels in blocks of one size; those at its upper ends may be smaller.
class BlockLattice {
 public:
    /// Blocks of `extent` voxels, multiples of the step. The box grows to multiples of the step.
    BlockLattice(const openvdb::CoordBBox& box, const openvdb::Coord& extent, const BlockRules& rules = {});
    /// The largest blocks that take at most so many voxels with what is read around them, as few as may be;
    /// NumericalError where no block is so small.
    static BlockLattice of_volume(const openvdb::CoordBBox& box, double voxels, const BlockRules& rules = {});

    /// Blocks; none where the box is empty.
    std::size_t size() const;
    /// Blocks follow each other along the first axis of the order, then the second.
    openvdb::CoordBBox block(std::size_t n) const;
    /// The block and what is read around it, as far as the box goes.
    openvdb::CoordBBox wanted(std::size_t n) const;
    /// The block without an outer border: where it lies at an end of the box it goes on to the end of the
    /// indices.
    openvdb::CoordBBox without_border(std::size_t n) const;
    /// Where a block lies among the others along x, y and z, from 0, and the number of the one at a place.
    openvdb::Coord place(std::size_t n) const;
    std::size_t at(const openvdb::Coord& place) const;
    /// Blocks along x, y and z.
    const openvdb::Coord& count() const { return count_; }
    const openvdb::Coord& extent() const { return extent_; }
    /// Voxels of the largest block with what is read around it.
    double largest() const;

 private:
    openvdb::CoordBBox box_;
    openvdb::Coord extent_, count_{0, 0, 0};
    BlockRules rules_;
};

}  // namespace vdbgeo
