// A grid in a VDB file → dense sections, while its voxels stay in the file.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "converters/dense_sections.h"
#include "converters/mrc.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {

/// Opens a grid of floats in a VDB file and notes where its leaves lie; their voxels are decoded when they
/// are asked for, by OpenVDB's own leaf. Checked as by read_vdb, errors as there. Memory: 4 bytes a leaf, 550
/// a node of 128³ voxels (twenty thousandths of the voxels' bytes), and what read_vdb would need for tiles.
class VdbSections {
 public:
    /// `grid` unset: "density", else the first grid of floats.
    explicit VdbSections(const std::filesystem::path& path, const std::optional<std::string>& grid = {});
    ~VdbSections();
    VdbSections(VdbSections&&) noexcept;

    /// The grid without its leaves: name, metadata, transform, background and tiles.
    const openvdb::FloatGrid& grid() const;
    /// Where it lies; bounded where the metadata tell the box.
    const Frame& frame() const;
    std::uint64_t active_voxels() const;
    std::uint64_t leaves() const;
    const openvdb::CoordBBox& active_box() const;
    /// Bytes that the notes take.
    std::uint64_t memory() const;

    /// Sections of this grid, which must live as long. Leaves are read with pread and decoded on all threads,
    /// each once for every slab of eight sections that it lies in, so once.
    DenseSections sections(const Vec3i& first, const Vec3i& size, const std::array<int, 3>& order) const;

    /// Finds leaves for one thread: the leaf whose first voxel is at `corner` (valid until the next call), or
    /// null where there is none; `tile` is then the value of all its voxels. The grid must live as long.
    using Leaves = std::function<const leaf::Leaf*(const openvdb::Coord& corner, float& tile)>;
    Leaves leaf_reader() const;

    /// The grid's name, metadata, transform and background, for a tree that has yet to come.
    openvdb::FloatGrid::Ptr empty_grid() const;
    /// Where its leaves and tiles lie, in the order of the tree: nodes of 128³ voxels, and larger tiles that
    /// are active or differ from the background.
    std::vector<openvdb::CoordBBox> pieces() const;
    /// Adds the leaves and tiles that touch the box to a tree with the background of the grid; leaves are
    /// decoded on all threads.
    void copy_to(const openvdb::CoordBBox& box, openvdb::FloatTree& to, const Progress& progress = {}) const;

 private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Sorts pieces of several grids into the order of a tree, each once.
void sort_pieces(std::vector<openvdb::CoordBBox>& pieces);

/// Writes the grid as write_mrc does, to the same bytes, with eight sections in memory.
MrcWriteReport write_mrc(const VdbSections& grid, const std::filesystem::path& path,
                         const MrcWriteOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
