// Marching cubes of a map that is read block after block.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "vdbgeo/blocks/block_lattice.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/surface_parts.h"

namespace vdbgeo {

/// Gives the leaves and tiles of a map that touch a box, with the frame of the whole.
using ReadBox = std::function<DensityMap(const openvdb::CoordBBox& wanted, const Progress& progress)>;

/// The surface of marching_cubes in two passes over a map of which one block at a time is in memory: count,
/// when it is made, then fill. With every run of the pieces put where it belongs, the mesh has the bytes of
/// marching_cubes of the whole map, for any lattice.
///
/// Memory: that of one block (bytes_a_voxel), 44 bytes for each column of 8 × 8 × 128 voxels that the surface
/// crosses, and while it is filled 304 bytes for each crossed block of 8³ voxels along the lower faces of the
/// blocks that are not filled yet.
class BlockMarchingCubes {
 public:
    /// The most that a voxel of a block takes, with what is read around it: where noise crosses every cell.
    static constexpr double bytes_a_voxel = 8;

    /// Counts. `lattice` covers all of the map that differs from the background, with blocks as BlockRules
    /// are by default. Throws what marching_cubes throws, and what `read` does.
    BlockMarchingCubes(ReadBox read, const BlockLattice& lattice, const MarchingCubesOptions& options,
                       const Progress& progress = {});

    std::uint64_t vertices() const { return numbers_->vertices(); }
    std::uint64_t triangles() const { return numbers_->triangles(); }
    /// Leaves of the map in all blocks, those around a block counted with each.
    std::uint64_t leaves() const { return leaves_; }

    /// Hands out the mesh in pieces of about `bytes`, or little more; once.
    void fill(std::size_t bytes, const std::function<void(const SurfacePiece&)>& take,
              const Progress& progress = {});

 private:
    struct Part {
        DensityMap map;
        SurfacePart surface;
    };

    Part read_part(std::size_t n, const Progress& progress) const;
    std::vector<BorderBlock> above(std::size_t n) const;
    void keep_border(std::size_t n, const SurfacePart& surface);

    ReadBox read_;
    BlockLattice lattice_;
    float isovalue_;
    std::vector<char> crossed_;  // of each block whether the surface runs through it
    std::uint64_t leaves_ = 0;
    std::optional<SurfaceNumbers> numbers_;
    std::optional<Part> last_;  // of the last block: it is the first to be filled
    std::map<std::size_t, std::vector<BorderBlock>> border_;  // of blocks whose lower neighbours need them
};

}  // namespace vdbgeo
