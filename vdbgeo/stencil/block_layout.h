// The working layout of the stencil operators: the active leaves of a grid as bricks in one array, and the
// cells of 4 × 4 × 16 leaves that tiles are made of.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace vdbgeo::stencil {

/// The leaves of a tree that have active voxels, in the order in which operators go through them, with their
/// masks. A brick is a leaf's 512 floats as OpenVDB orders them (z fastest).
///
/// Leaves are gathered in cells of 32 × 32 × 128 voxels at multiples of these; each cell knows its leaves and
/// its 26 neighbours, so that a tile with a halo of up to 32 voxels is gathered without a search. Cells are
/// sorted by y ("slabs": all cells of one y), then z, then x; a run of cells along x has its bricks in the
/// order in which it is swept. Coordinates are those of the grid; cells lie at absolute positions, so nothing
/// depends on what else is active.
class BlockLayout {
 public:
    static constexpr int leaves_x = 4, leaves_y = 4, leaves_z = 16;  ///< leaves in a cell
    static constexpr int size_x = 32, size_y = 32, size_z = 128;     ///< voxels in a cell
    static constexpr int max_halo = 32;                              ///< voxels
    static constexpr std::int32_t none = -1;

    using Mask = std::array<std::uint64_t, 8>;  ///< word x, bit 8y + z

    struct Cell {
        openvdb::Coord origin;  ///< first voxel
        /// Brick of leaf (x, y, z) of the cell at (x · leaves_y + y) · leaves_z + z, or none.
        std::array<std::int32_t, leaves_x * leaves_y * leaves_z> bricks;
        /// Cell at offset (dx, dy, dz), each −1…1, at ((dx+1) · 3 + dy+1) · 3 + dz+1, or none.
        std::array<std::int32_t, 27> neighbors;
        bool own = true;  ///< operators work on some of it; others only are there for their neighbours
    };
    /// Bricks [begin, end) and cells [first_cell, last_cell) of one y.
    struct Slab {
        std::size_t begin, end, first_cell, last_cell;
    };
    /// Cells [first, last), neighbours along x.
    struct Run {
        std::int32_t first, last;
    };

    BlockLayout() = default;
    /// Throws InvalidInput where the tree has active tiles (voxelizeActiveTiles makes leaves of them), or
    /// more than 2^31 leaves. Cost: about 0.3 µs a leaf; 70 to 80 bytes a leaf, 12 for each in a full cell.
    /// `own`: what to work on, as work_on; unset: all.
    explicit BlockLayout(const openvdb::FloatTree& tree, const std::optional<openvdb::CoordBBox>& own = {});

    /// The same of leaves that are listed: their first voxels, in any order, and their masks. Those whose
    /// mask is empty are left out.
    struct LeafMask {
        openvdb::Coord origin;
        Mask mask;
    };
    explicit BlockLayout(std::vector<LeafMask> leaves, const std::optional<openvdb::CoordBBox>& own = {});
    /// From now on operators work on the voxels in this box; what they leave in the rest of the leaves that
    /// it cuts is not told. Sums are over the leaves that begin in it.
    void work_on(const openvdb::CoordBBox& box);
    bool works_on(std::size_t brick) const { return work_.isInside(origins_[brick]); }
    /// What of a cell is worked on.
    openvdb::CoordBBox work_in(const Cell& cell) const {
        openvdb::CoordBBox box(cell.origin, cell.origin.offsetBy(size_x - 1, size_y - 1, size_z - 1));
        box.intersect(work_);
        return box;
    }

    std::size_t brick_count() const { return origins_.size(); }
    /// Active voxels of the leaves that are worked on: counts them.
    std::uint64_t active_count() const;
    const openvdb::Coord& origin(std::size_t brick) const { return origins_[brick]; }
    const Mask& mask(std::size_t brick) const { return masks_[brick]; }
    bool full(std::size_t brick) const { return full_[brick] != 0; }
    const std::vector<Cell>& cells() const { return cells_; }
    const std::vector<Slab>& slabs() const { return slabs_; }
    /// The runs of a slab's own cells: at most `length` cells long, starting at multiples of it where cells
    /// are complete.
    std::vector<Run> runs(const Slab& slab, int length) const;
    /// Cell of the cell's neighbourhood; null where there is none.
    const Cell* neighbor(const Cell& cell, int dx, int dy, int dz) const {
        const std::int32_t n = cell.neighbors[static_cast<std::size_t>(((dx + 1) * 3 + dy + 1) * 3 + dz + 1)];
        return n == none ? nullptr : &cells_[static_cast<std::size_t>(n)];
    }
    /// Bytes this object takes.
    std::size_t memory() const;

 private:
    template <class LeafAt>
    void take(std::size_t leaves, const std::optional<openvdb::CoordBBox>& own, const LeafAt& leaf_at);
    void make_cells();
    void make_neighbors();

    std::vector<openvdb::Coord> origins_;
    std::vector<Mask> masks_;
    std::vector<std::uint8_t> full_;
    std::vector<Cell> cells_;
    std::vector<Slab> slabs_;
    openvdb::CoordBBox work_ = openvdb::CoordBBox::inf();
};

}  // namespace vdbgeo::stencil
