// A grid that never is in memory as a tree: its leaves are packed for the file as they are made.
#pragma once

#include <memory>
#include <vector>

#include "converters/byte_store.h"
#include "converters/self_writing_grid.h"
#include "vdbgeo/volume/rounding.h"
#include "vdbgeo/volume/sparsify.h"

namespace vdbgeo {

/// Takes the sorted strips of a map and keeps what a VDB file will hold of them: leaves in the file's own
/// form, compressed, and their places. A file has its leaves in the order of the tree (x slowest), strips
/// come section by section; so what belongs to one node of 128³ voxels is put down together, slab by slab,
/// and picked up again when its turn comes. Memory: `memory` bytes of packed leaves, the rest on the disk,
/// and 24 bytes for 128 × 128 × 8 voxels.
class PackedLeaves {
 public:
    PackedLeaves(const StripSorter& sorter, const VdbWriteOptions& options, std::uint64_t memory,
                 const std::filesystem::path& scratch);

    /// What a strip becomes; in any thread.
    struct Row;
    std::shared_ptr<const Row> pack(const SortedStrip& strip) const;
    /// The rows of one slab, first to last, and the slabs from the first on.
    void add_slab(const std::vector<std::shared_ptr<const Row>>& rows);

    std::uint64_t leaves() const { return leaves_; }
    std::uint64_t active_voxels() const { return active_; }
    const openvdb::CoordBBox& active_box() const { return box_; }
    /// What the grid would take in memory as a tree.
    std::uint64_t bytes_as_tree() const;
    std::uint64_t spilled() const { return store_.spilled(); }
    bool half() const { return options_.half; }
    /// What storing 16-bit floats costs, where that is asked for.
    const RoundingError& half_error() const { return half_error_; }

    void write_topology(std::ostream& os, float background) const;
    void write_buffers(std::ostream& os, const Progress& progress) const;

 private:
    /// The leaves of one node of 128³ voxels in one slab: their heads, then their buffers, in the store.
    struct Run {
        std::uint64_t at = 0, body_bytes = 0;
        std::uint32_t heads = 0;
    };
    struct Head;
    struct Node;  // all runs of one node, picked up

    std::size_t node_index(const openvdb::Coord& node) const;
    template <class Visit>
    void for_each_root_child(const Visit& visit) const;
    template <class Visit>
    void for_each_node(const openvdb::Coord& root_child, const Visit& visit) const;
    Node pick_up(std::size_t node, bool bodies) const;
    void write_upper_node(std::ostream& os, const openvdb::Coord& root_child, float background) const;
    void write_lower_node(std::ostream& os, std::size_t node, float background) const;

    VdbWriteOptions options_;
    std::array<int, 3> order_;
    bool only_background_;                // among the inactive values of leaves
    openvdb::Coord nodes_;                // nodes of 128³ voxels along x, y, z
    std::vector<std::vector<Run>> runs_;  // of each of them
    ByteStore store_;
    std::uint64_t leaves_ = 0, active_ = 0;
    openvdb::CoordBBox box_;
    RoundingError half_error_;
};

/// PackedLeaves as a grid: metadata and transform as of any grid; the tree is empty, and only the counts, the
/// bounding box and what is written to a file are those of the leaves.
class StreamedGrid : public SelfWritingGrid {
 public:
    StreamedGrid(std::shared_ptr<const PackedLeaves> leaves, float background);

    openvdb::Index64 activeVoxelCount() const override { return leaves_->active_voxels(); }
    openvdb::CoordBBox evalActiveVoxelBoundingBox() const override { return leaves_->active_box(); }
    openvdb::Index64 memUsage() const override { return leaves_->bytes_as_tree(); }
    bool empty() const override { return leaves_->active_voxels() == 0; }
    void writeBuffers(std::ostream& os) const override { leaves_->write_buffers(os, progress()); }
    const PackedLeaves& leaves() const { return *leaves_; }

 private:
    void write_nodes(std::ostream& os) const override { leaves_->write_topology(os, background()); }

    std::shared_ptr<const PackedLeaves> leaves_;
};

}  // namespace vdbgeo
