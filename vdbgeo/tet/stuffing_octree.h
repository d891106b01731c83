// The graded cubes that isosurface stuffing fills: an octree over the lattice. For isosurface_stuffing;
// nothing outside this folder needs it.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/tet/stuffing_snap.h"

namespace vdbgeo::stuffing {

/// A cube of 2^level cells; `at` counts cubes of its size.
struct Octant {
    int level = 0;
    Coord at;

    Octant parent() const { return {level + 1, Coord(at[0] >> 1, at[1] >> 1, at[2] >> 1)}; }
    Octant moved(int axis, int step) const {
        Octant o = *this;
        o.at[axis] += step;
        return o;
    }
    /// Its lower corner in cells.
    Coord origin() const { return {at[0] * (1 << level), at[1] * (1 << level), at[2] * (1 << level)}; }
};

/// Which cubes of 2^level cells are not divided. Cells at a point with a crossed edge are all of level 0: the
/// eight around a corner, and around a centre its own and the six that share a face with it; so every
/// tetrahedron at such a point is one of the uniform lattice. All others are as large as balance allows:
/// leaves that share a face or an edge differ by one level at most.
class Octree {
 public:
    Octree(const SnappedLattice& points, int coarsening, const Progress& progress);

    /// Whether the octant lies in a leaf of its level or above. False where nothing is inside; at level 0
    /// true for every cell that is not held at level 0, too.
    bool whole(const Octant& octant) const;
    bool is_leaf(const Octant& octant) const { return whole(octant) && !whole(octant.parent()); }

    /// Octants of level 1 and 2 in block b that lie in a leaf of their level or above: bit 16·x + 4·y + z,
    /// and 4·x + 2·y + z.
    std::uint64_t level_1(std::size_t b) const { return nodes_[b].level_1; }
    std::uint8_t level_2(std::size_t b) const { return nodes_[b].level_2; }
    /// Level of the leaf that covers the block, or 0.
    int top(std::size_t b) const { return nodes_[b].top; }

    /// Calls f(octant) for each leaf of level 1 or above that begins in block b.
    template <class F>
    void for_each_leaf(std::size_t b, const F& f) const;

 private:
    struct Node {
        std::uint64_t level_1 = 0;
        std::uint8_t level_2 = 0, top = 0;
    };
    std::uint64_t merge_cells(const SnappedLattice& points, std::size_t b) const;
    bool surrounded(const Octant& octant) const;
    void merge_blocks(int level);
    /// Whether `holds` holds for the block and all around it.
    template <class Holds>
    bool all_around(std::size_t b, const Holds& holds) const {
        for (const std::int32_t n : table_[b].around)
            if (n < 0 || !holds(nodes_[static_cast<std::size_t>(n)])) return false;
        return true;
    }

    const BlockTable& table_;
    int coarsening_;
    std::vector<Node> nodes_;
};

template <class F>
void Octree::for_each_leaf(std::size_t b, const F& f) const {
    const Node& node = nodes_[b];
    const Coord& at = table_[b].at;
    if (node.top >= 3) {
        const int shift = node.top - 3, rest = (1 << shift) - 1;
        if (((at[0] | at[1] | at[2]) & rest) == 0)
            f(Octant{node.top, Coord(at[0] >> shift, at[1] >> shift, at[2] >> shift)});
        return;
    }
    for (int k = 0; k < 8; ++k)
        if (node.level_2 >> k & 1)
            f(Octant{2, Coord(2 * at[0] + (k >> 2), 2 * at[1] + (k >> 1 & 1), 2 * at[2] + (k & 1))});
    for (std::uint64_t left = node.level_1; left; left &= left - 1) {
        const int bit = __builtin_ctzll(left), x = bit >> 4, y = bit >> 2 & 3, z = bit & 3;
        if (node.level_2 >> ((x >> 1) * 4 + (y >> 1) * 2 + (z >> 1)) & 1) continue;
        f(Octant{1, Coord(4 * at[0] + x, 4 * at[1] + y, 4 * at[2] + z)});
    }
}

}  // namespace vdbgeo::stuffing
