// Which leaves a map has, and where their bricks stand in files that hold one brick for each.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "vdbgeo/core/scratch_file.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo {

/// The active leaves of a map by cells of 32 × 32 × 128 voxels (stencil::BlockLayout), numbered in the order
/// in which a layout of the whole map would have its bricks. Memory: 64 bytes a cell, of up to 256 leaves,
/// and 64 for each leaf that is not full.
class BrickIndex {
 public:
    struct Cell {
        openvdb::Coord origin;
        std::uint32_t first_mask = 0;  ///< of those leaves that are not full
        std::uint64_t first_brick = 0;
        std::array<std::uint64_t, 4> leaves{}, partial{};  ///< bits by place in the cell
        int count() const;
    };

    /// The own cells of layouts, in any order.
    void add(const stencil::BlockLayout& part);
    /// Numbers the bricks; call it once, when all cells are there.
    void finish();

    const std::vector<Cell>& cells() const { return cells_; }
    std::uint64_t brick_count() const { return bricks_; }
    std::size_t memory() const;

    /// Bricks [first, first + count) of the map, which are those from `at` on of a part's layout.
    struct Run {
        std::uint64_t first;
        std::size_t at, count;
    };
    /// The leaves that begin in a box, and their bricks in runs, both in the order of a layout.
    struct Part {
        std::vector<stencil::BlockLayout::LeafMask> leaves;
        std::vector<Run> runs;
    };
    Part part(const openvdb::CoordBBox& box) const;
    /// Of a part's runs what belongs to the leaves that begin in a box.
    static std::vector<Run> within(const Part& part, const openvdb::CoordBBox& box);

 private:
    std::vector<Cell> cells_;
    std::vector<stencil::BlockLayout::Mask> masks_;
    std::uint64_t bricks_ = 0;
};

/// A field of a map in files without names: a brick for each of an index. They are several, since a file
/// system lets but one thread write to a file.
class BrickFile {
 public:
    explicit BrickFile(const std::filesystem::path& folder);
    /// `field` has the bricks of a part's layout.
    void read(const std::vector<BrickIndex::Run>& runs, float* field) const;
    void write(const std::vector<BrickIndex::Run>& runs, const float* field);

 private:
    std::vector<std::unique_ptr<ScratchFile>> files_;
};

}  // namespace vdbgeo
