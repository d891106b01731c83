// Marching cubes of a part of a grid, with the vertex and triangle numbers of the whole. For marching_cubes
// and for what goes through a map in parts; nothing else needs it.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/surface/cell_kernels.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// Blocks of 8³ voxels above each other along z, within a node of 128³. The mesh has the vertices, and the
/// triangles, of a column one behind the other, so columns are what parts number their meshes by.
struct SurfaceColumn {
    openvdb::Coord origin;  ///< multiples of 8, 8 and 128
    std::uint32_t vertices = 0, triangles = 0;
};

/// Where the vertices and triangles of each column stand in the whole mesh: columns follow each other as in
/// marching_cubes, by node (x slowest) and then by their place in it.
class SurfaceNumbers {
 public:
    struct Column {
        openvdb::Coord origin;
        std::uint32_t first_vertex = 0;
        std::uint64_t first_triangle = 0;
    };

    /// The columns of all parts, each once, in any order. InvalidInput for a mesh of 2^32 vertices or more.
    explicit SurfaceNumbers(std::vector<SurfaceColumn> columns);

    std::uint64_t vertices() const { return vertices_; }
    std::uint64_t triangles() const { return triangles_; }
    /// The column that holds a block. It has to be among those given.
    const Column& column_of(const openvdb::Coord& block) const;

 private:
    std::vector<Column> columns_;
    std::uint64_t vertices_ = 0, triangles_ = 0;
};

/// A block whose edges cells of other parts share.
struct BorderBlock {
    openvdb::Coord origin;
    std::uint32_t vertex_in_column = 0;  ///< its first, from the first of its column
    /// Bit s: the block one step down along the axes that are set in s has such cells, in another part.
    std::uint32_t below = 0;
    cell::EdgeBits edges{};

    /// The block of bit `side` of `below`.
    openvdb::Coord block_below(int side) const;
};

/// `count` vertices, or triangles, that follow each other in the mesh.
struct SurfaceRun {
    std::uint64_t first = 0;  ///< number in the whole mesh
    std::uint64_t count = 0;
};

/// Some of a mesh: run after run, in the order of the whole. Triangles name vertices by their numbers in the
/// whole mesh, so also such as lie in other pieces.
struct SurfacePiece {
    Array<Vec3f> points;
    Array<Triangle> triangles;
    std::vector<SurfaceRun> point_runs, triangle_runs;
};

/// The surface in the blocks of a part, in two passes: count, when it is made, then fill. In between the
/// parts tell each other what they have counted (`columns`, `border`), which depends on nothing but the map,
/// so that a part can also be made a second time to be filled.
///
/// Time and memory: those of marching_cubes for the part.
class SurfacePart {
 public:
    /// Finds and counts the blocks that begin in `own`, whose faces lie at multiples of 8, 8 and 128 voxels;
    /// an unbounded side is a side at an end of the indices. `part.grid` needs the leaves and tiles of the
    /// box and of 8 voxels above it, and is referred to; `part.frame` is the whole map's. Throws what
    /// marching_cubes throws for the whole map where the part is to blame.
    SurfacePart(const DensityMap& part, float isovalue,
                const openvdb::CoordBBox& own = openvdb::CoordBBox::inf(), const Progress& progress = {});
    SurfacePart(SurfacePart&&) noexcept;
    SurfacePart& operator=(SurfacePart&&) noexcept;
    ~SurfacePart();

    /// Those that hold anything, in their order in the mesh.
    std::vector<SurfaceColumn> columns() const;
    /// What the parts below need to know.
    std::vector<BorderBlock> border() const;

    /// Takes the numbers from the columns of all parts. `above` has what this part's upper neighbours gave as
    /// border; what others gave may be among it.
    void number(const SurfaceNumbers& numbers, const std::vector<BorderBlock>& above = {});
    /// All of the part's mesh, once it is numbered.
    SurfacePiece fill(const Progress& progress = {}) const;
    /// Some blocks at a time, so that pieces have about so many bytes, or little more: for a mesh that is to
    /// be written rather than held.
    void fill(std::size_t bytes, const std::function<void(const SurfacePiece&)>& take,
              const Progress& progress = {}) const;

 private:
    class Extraction;
    std::unique_ptr<Extraction> extraction_;
};

}  // namespace vdbgeo
