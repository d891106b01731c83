// The leaves of a sparse grid → dense sections.
#pragma once

#include <array>
#include <functional>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// Finds leaves for one thread: the values of the leaf whose first voxel is at `corner` (valid until the next
/// call), or nullptr where there is none; `tile` is then the value of all its voxels.
using LeafLookup = std::function<const float*(const openvdb::Coord& corner, float& tile)>;

/// Hands out a box of a grid section by section, as GridBuilder takes them in: order[0] is the axis that runs
/// fastest, order[2] the one along which sections follow each other. Every sample has the grid's stored
/// value, active or not.
class DenseSections {
 public:
    DenseSections(const openvdb::FloatGrid& grid, const Vec3i& first, const Vec3i& size,
                  const std::array<int, 3>& order);
    /// A grid that is not in memory; `leaves` makes a lookup for each thread that asks.
    DenseSections(std::function<LeafLookup()> leaves, const Vec3i& first, const Vec3i& size,
                  const std::array<int, 3>& order)
        : leaves_(std::move(leaves)), first_(first), size_(size), order_(order) {}

    int sections() const { return size_[order_[2]]; }
    /// Sections in the piece that starts with section `section`: up to the border of the leaves there.
    int piece(int section) const;
    /// The most samples that a piece has.
    std::size_t largest_piece() const;
    /// Writes piece(section) sections to `out`, in parallel.
    void fill(int section, float* out) const;

 private:
    void fill_row_of_leaves(int section, int row_leaf, float* out) const;

    std::function<LeafLookup()> leaves_;
    Vec3i first_, size_;
    std::array<int, 3> order_;
};

}  // namespace vdbgeo
