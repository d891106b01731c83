// vdbgeo surface within --memory: the map is read block after block where it does not fit.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "apps/session.h"
#include "converters/map_blocks.h"
#include "converters/mesh_pieces.h"
#include "vdbgeo/blocks/block_marching_cubes.h"
#include "vdbgeo/volume/isovalue.h"

namespace vdbgeo::app {

/// Turns a level set into a density: what is inside is above 0 (and above the negated isovalue).
void turn_over(DensityMap& level_set);

/// NumericalError where a surface has no faces, telling the map's range.
void need_surface(const std::string& name, std::uint64_t faces, double isovalue, const Statistics& of_map);

/// Puts what a piece holds where it belongs.
void put_piece(const SurfacePiece& piece, PlyPieces& file);

/// Bytes that are taken where map and surface are in memory, and the surface is measured.
struct WholeNeed {
    double a_leaf = 2800;    ///< with its place in the tree, and what a method notes of it
    double a_triangle = 64;  ///< of marching cubes, with its share of the vertices

    // With what their meshes and their own structures take, of noisy maps of 200³ voxels.
    static WholeNeed of_pieces() { return {2800, 100}; }
    static WholeNeed of_dual() { return {2800, 130}; }
    static WholeNeed of_delaunay() { return {2800, 500}; }
    static WholeNeed of_labels() { return {5600, 300}; }
};

/// A map whose surface by marching cubes is counted, but neither of which is in memory.
class SurfaceInBlocks {
 public:
    /// Opens the map, says what is odd about it, and counts. UsageError for an isovalue that needs the
    /// samples in memory, where these do not fit; NumericalError where the memory suffices for no block.
    SurfaceInBlocks(const std::string& in, const MapReadOptions& options, const Isovalue& rule,
                    Session& session);

    /// About the memory that the map and the surface take, and what measures the surface.
    double bytes_as_whole(const WholeNeed& need = {}) const;
    /// The map in memory.
    MapFile whole(Session& session);
    /// Writes the surface as write_mesh would, to the same bytes; nothing where that fails. NumericalError
    /// where nothing crosses the isovalue.
    void write(const std::string& out, Session& session);

    std::uint64_t vertices() const { return surface_ ? surface_->vertices() : 0; }
    std::uint64_t triangles() const { return surface_ ? surface_->triangles() : 0; }
    double isovalue() const { return isovalue_; }
    std::size_t blocks() const { return blocks_; }

 private:
    void count(const Isovalue& rule, Session& session);
    BlockLattice lattice() const;

    std::string in_;
    MapReadOptions options_;
    std::unique_ptr<MapBlocks> map_;
    std::unique_ptr<BlockMarchingCubes> surface_;  // none where the samples are needed first
    std::size_t blocks_ = 0;
    double isovalue_ = 0;
};

}  // namespace vdbgeo::app
