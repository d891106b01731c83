// The vertices and tetrahedra of isosurface stuffing. For isosurface_stuffing; nothing outside this folder
// needs it.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/tet/stuffing_octree.h"

namespace vdbgeo::stuffing {

/// Numbers of the vertices: by block; in a block the corners in use by slot, then the centres, then the cut
/// points by class and slot.
class VertexTable {
 public:
    VertexTable(const SnappedLattice& points, const Octree& octree);

    std::uint64_t size() const { return size_; }
    /// Whether the corner (in cells) is a vertex.
    bool has_corner(std::size_t near_block, const Coord& c) const;
    VertexId corner_at(std::size_t near_block, const Coord& c) const;
    /// The point of a slot of block b, each −8…15, that is a vertex.
    VertexId at(std::size_t b, Kind kind, int x, int y, int z) const;
    /// The cut point on the edge of that class that the slot owns.
    VertexId cut_at(std::size_t b, int edge_class, int x, int y, int z) const;
    bool used(std::size_t b, Kind kind, int x, int y, int z) const;
    /// Writes the positions of block b's vertices.
    void place(const Lattice& lattice, std::size_t b, Array<Vec3d>& out) const;

 private:
    struct Numbers {
        std::array<RankedBits, 2> used;
        std::uint64_t first = 0;  // vertex of the block
        int cuts = 0;             // its first cut point, from there
    };
    using Marks = std::vector<std::atomic<std::uint64_t>>;
    void mark_cells(std::size_t b, Marks& marks) const;
    void mark_leaves(std::size_t b, Marks& marks) const;
    std::int32_t block_near(std::size_t b, const Coord& cell) const;

    const SnappedLattice& points_;
    const Octree& octree_;
    std::vector<Numbers> numbers_;
    std::uint64_t size_ = 0;
};

/// The cells of a block, and around it, that are of level 0.
Halo cells_of_level_0(const SnappedLattice& points, const Octree& octree, std::size_t b);

/// Makes the mesh. Throws NumericalError for more than max_tets tetrahedra or 2^32 − 1 vertices, before the
/// mesh takes memory, and where an angle is out of bounds.
TetMesh fill(const Lattice& lattice, const SnappedLattice& points, const Octree& octree,
             std::uint64_t max_tets, const Progress& progress);

}  // namespace vdbgeo::stuffing
